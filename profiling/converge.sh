#!/usr/bin/env bash
# Error against run time: profiling/converge.sh [DIRECTORY]
#
# The wavefront against the plain reference integrator at equal error, on every scene in scenes/; sampling
# strategies and samplers on four of them; the table of the hexagonal room; and the CPU time to 3 % relative error
# on hexroom-exact. Writes a folder per comparison, with its summary in summary.txt, to DIRECTORY (default
# profiling/results/converge). References are rendered once and kept in DIRECTORY/cache. The last comparison
# takes some CPU hours, most of them for its reference; LEAVE_OUT_HEXROOM=1 leaves it out.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")/.."

directory=${1:-profiling/results/converge}
cargo build --release --quiet
mkdir -p "$directory"

converge() {
    local name=$1 scene=$2
    shift 2
    echo "== $name"
    mkdir -p "$directory/$name"
    target/release/wavepath converge "scenes/$scene.toml" --cache "$directory/cache" --out "$directory/$name" \
        --quiet "$@" 2>&1 | tee "$directory/$name/summary.txt"
}

for file in scenes/*.toml; do
    scene=$(basename "$file" .toml)
    integrators=path,reference
    grep -q '^integrator = "whitted"' "$file" && integrators=whitted
    converge "integrators-$scene" "$scene" --width 48 --height 48 --spp 64 --threads 1 --vary integrator=$integrators \
        --reference-error 0.05 --reference-seconds 60
done
for scene in furnace panel cornell many-lights; do
    converge "estimators-$scene" "$scene" --width 64 --height 64 --spp 128 --threads 1 --vary strategy=mis,nee,bsdf \
        --vary sampler=independent,stratified --reference-error 0.02 --reference-seconds 120
done
converge table hexroom --table --width 200 --height 200 --repeats 3 --reference-error 0.05 --reference-seconds 600
if [ -z "${LEAVE_OUT_HEXROOM:-}" ]; then
    converge hexroom-time hexroom-exact --width 200 --height 200 --spp 32768 --repeats 3 --threads 1 \
        --reference-error 0.02 --reference-seconds 2000
fi
