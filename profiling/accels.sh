#!/usr/bin/env bash
# Compares acceleration structures with Embree 4 over scenes of 32 to 8 million triangles:
# profiling/accels.sh [DIRECTORY [THREADS...]]
#
# Needs EMBREE_LIBRARY (libembree4, or a folder with it) and WAVEPATH_MESHES (the folder of real meshes).
# Writes one table per scene and number of threads to DIRECTORY (default profiling/results), and
# summary.txt: per kind of ray our best and Embree's best, in millions of rays per CPU second.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")/.."

directory=${1:-profiling/results}
shift || true
threads=("${@:-1}")
: "${EMBREE_LIBRARY:?is the path of libembree4}" "${WAVEPATH_MESHES:?is the folder of meshes}"
program=target/release/wavepath

cargo build --release --features embree --quiet
mkdir -p "$directory"
printf '%-15s %s  %-9s %8s %-11s %8s %-24s %6s\n' scene t rays ours by Embree by ratio >"$directory/summary.txt"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$program" mesh hairball --triangles 3000000 -o "$scratch/hairball.obj" --quiet
"$program" mesh terrain --triangles 8000000 -o "$scratch/terrain.obj" --quiet

scenes=(
    "cornell scenes/cornell.toml"
    "bunny $WAVEPATH_MESHES/small/stanford-bunny.obj.zst"
    "sponza $WAVEPATH_MESHES/medium/sponza-crytek/sponza.obj.zst"
    "dragon $WAVEPATH_MESHES/medium/stanford-dragon.obj.zst"
    "hairball $scratch/hairball.obj"
    "star-destroyer $WAVEPATH_MESHES/large/lego-10030-star-destroyer.obj.zst"
    "terrain $scratch/terrain.obj"
)
ours=bvh8,packet,bvh8-best,packet-best,octree
theirs=embree-medium,embree-medium-packet,embree-medium-coherent,embree-high,embree-high-packet,embree-high-coherent
for count in "${threads[@]}"; do
    for scene in "${scenes[@]}"; do
        read -r name file <<<"$scene"
        structures=$ours,$theirs
        [ "$name" = cornell ] && structures=linear,$structures
        "$program" accels "$file" --structures "$structures" --threads "$count" --rounds 7 --count 262144 \
            --quiet >"$directory/$name-$count.txt" || echo "$name: exit code $?"
        awk -v scene="$name" -v threads="$count" '
            /^(primary|diffuse|diffuse2|shadow) / { kind = $1; next }
            kind == "" || NF < 3 { next }
            /^embree/ { if ($3 > theirs[kind]) { theirs[kind] = $3; who[kind] = $1 } next }
            /^(linear|bvh8|packet|octree)/ { if ($3 > ours[kind]) { ours[kind] = $3; own[kind] = $1 } }
            END {
                split("primary diffuse diffuse2 shadow", kinds)
                for (i = 1; i <= 4; i++) {
                    kind = kinds[i]
                    if (theirs[kind] > 0)
                        printf "%-15s %d  %-9s %8.2f %-11s %8.2f %-24s %6.2f\n", scene, threads, kind,
                            ours[kind], own[kind], theirs[kind], who[kind], ours[kind] / theirs[kind]
                }
            }' "$directory/$name-$count.txt" | tee -a "$directory/summary.txt"
    done
done
