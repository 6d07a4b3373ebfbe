#!/usr/bin/env bash
# Error against run time: profiling/converge.sh [DIRECTORY]
#
# The wavefront against the plain reference integrator at equal error, on every scene in scenes/; sampling
# strategies and samplers on four of them; the other choices of an estimator; the table of the hexagonal room; and
# the CPU time to 3 % relative error on hexroom-exact. Writes a folder per comparison, with its summary in summary.txt,
# to DIRECTORY (default profiling/results/converge). References are rendered once and kept in DIRECTORY/cache.
# The last takes a quarter of an hour of CPU time, two thirds of it to check the error; LEAVE_OUT_HEXROOM=1 leaves it
# out. WAVEPATH names another program than the one built here; PARTS, a list of integrators, estimators, choices,
# table and hexroom, leaves out the other parts; REFERENCE_SECONDS are the CPU seconds of a reference at most, but
# for the table's, which has 600.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")/.."

directory=${1:-profiling/results/converge}
program=${WAVEPATH:-target/release/wavepath}
seconds=${REFERENCE_SECONDS:-60}
parts=" ${PARTS:-integrators estimators choices table hexroom} "
[ -n "${WAVEPATH:-}" ] || cargo build --release --quiet
mkdir -p "$directory"

converge() {
    local name=$1 scene=$2
    shift 2
    echo "== $name"
    mkdir -p "$directory/$name"
    "$program" converge "scenes/$scene.toml" --cache "$directory/cache" --out "$directory/$name" \
        --quiet "$@" 2>&1 | tee "$directory/$name/summary.txt"
}

if [[ $parts == *" integrators "* ]]; then
    for file in scenes/*.toml; do
        scene=$(basename "$file" .toml)
        integrators=path,reference
        grep -q '^integrator = "whitted"' "$file" && integrators=whitted
        # These are hexroom with other sample counts, which do not count here.
        [[ $scene == hexroom-*spp ]] && continue
        converge "integrators-$scene" "$scene" --width 48 --height 48 --spp 64 --threads 1 \
            --vary integrator=$integrators --reference-error 0.05 --reference-seconds "$seconds"
    done
fi
if [[ $parts == *" estimators "* ]]; then
    for scene in furnace panel cornell many-lights; do
        converge "estimators-$scene" "$scene" --width 64 --height 64 --spp 128 --threads 1 \
            --vary strategy=mis,nee,bsdf --vary sampler=independent,stratified,sobol \
            --reference-error 0.02 --reference-seconds "$seconds"
    done
fi
if [[ $parts == *" choices "* ]]; then
    for scene in cornell hexroom-exact many-lights materials; do
        converge "choices-$scene" "$scene" --width 48 --height 48 --spp 64 --threads 1 \
            --config default= --config independent=sampler=independent --config stratified=sampler=stratified \
            --config roulette-2=roulette_depth=2 --config roulette-10=roulette_depth=10 \
            --config splits-3=glass_splits=3 --config lights-2=light_samples=2 --config lights-4=light_samples=4 \
            --config adaptive=adaptive=true --config wave-1024=wave=1024 --config wave-16384=wave=16384 \
            --config linear=accel=linear --config bvh8=accel=bvh8 \
            --reference-error 0.02 --reference-seconds "$seconds"
    done
fi
if [[ $parts == *" table "* ]]; then
    converge table hexroom --table --width 200 --height 200 --repeats 3 --reference-error 0.05 --reference-seconds 600
fi
if [[ $parts == *" hexroom "* && -z "${LEAVE_OUT_HEXROOM:-}" ]]; then
    echo "== hexroom"
    room=("$program" render scenes/hexroom-exact.toml --width 200 --height 200 --threads 1 --quiet)
    image=$directory/hexroom
    "${room[@]}" --error "${HEXROOM_ERROR:-0.03}" -o "$image.exr" --report "$image.json"
    # One key per line: the phase's CPU seconds, the samples, and the error that it tells.
    awk '/"render": \{/ { render = 1 }
        render && $1 == "\"cpu_seconds\":" { print; render = 0 }
        $1 == "\"mean_samples\":" || $1 == "\"relative_error\":"' "$image.json"
    # What it says of its error, held against two others: theirs to each other is twice the square of one's own.
    for seed in 1001 1002; do
        "${room[@]}" --spp "${HEXROOM_SAMPLES:-16384}" --seed "$seed" -o "$image-$seed.exr"
        "$program" compare "$image.exr" "$image-$seed.exr" | grep relMSE
    done
    "$program" compare "$image-1001.exr" "$image-1002.exr" | grep relMSE
fi
