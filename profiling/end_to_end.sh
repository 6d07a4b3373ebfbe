#!/usr/bin/env bash
# Camera paths per CPU second of two versions of the program on large meshes, interleaved:
# profiling/end_to_end.sh OLD_PROGRAM NEW_PROGRAM [ROUNDS]
#
# Needs WAVEPATH_MESHES (the folder of real meshes) and zstd. Grey meshes under a white sky, one thread, 480 × 360
# pixels, 4 samples per pixel, depth limit 6; medians over the rounds (default 3).
set -euo pipefail
export LC_ALL=C
old=$(realpath "$1") new=$(realpath "$2") rounds=${3:-3}
: "${WAVEPATH_MESHES:?is the folder of meshes}"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
zstd -dqo "$scratch/dragon.obj" "$WAVEPATH_MESHES/medium/stanford-dragon.obj.zst"
zstd -dqo "$scratch/sponza.obj" "$WAVEPATH_MESHES/medium/sponza-crytek/sponza.obj.zst"
"$new" mesh hairball --triangles 3000000 -o "$scratch/hairball.obj" --quiet
cd "$scratch"

# scene NAME EYE TARGET FOV
scene() {
    cat >"$1.toml" <<SCENE
film = { width = 480, height = 360 }
background = { radiance = 1 }
cameras.view = { eye = [$2], look_at = [$3], up = [0, 1, 0], fov = $4 }
materials.chalk = { type = "lambertian", reflectance = 0.6 }
shapes = [{ type = "obj", file = "$1.obj", material = "chalk" }]
SCENE
}
scene dragon "0.1, 0.25, 0.35" "0, 0.12, 0" 35
scene sponza "1150, 180, -30" "-1000, 330, -30" 55
scene hairball "1.5, 1.2, 2.5" "0, 0, 0" 35

for name in dragon sponza hairball; do
    for ((round = 0; round < rounds; round++)); do
        for version in old new; do
            "${!version}" render "$name.toml" --spp 4 --threads 1 --max-depth 6 --sampler independent --quiet \
                --output image.png --report report.json
            awk -v version="$version" '/"per_cpu_second":/ && !seen { seen = 1; print version, $2 + 0 }' \
                report.json >>"$name.txt"
        done
    done
    for version in old new; do
        awk -v version="$version" '$1 == version { print $2 }' "$name.txt" | sort -g |
            awk '{ value[NR] = $1 } END { print value[int((NR + 1) / 2)] }' >"$version.txt"
    done
    paste old.txt new.txt | awk -v name="$name" \
        '{ printf "%-10s old %8.0f  new %8.0f paths per CPU second  %5.2f x\n", name, $1, $2, $2 / $1 }'
done
