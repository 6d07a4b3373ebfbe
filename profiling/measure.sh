#!/usr/bin/env bash
# Measures the renderer in CPU seconds: profiling/measure.sh [ROUNDS [DIRECTORY]]
#
# Builds the release program and measures, interleaved, ROUNDS times (default 7):
#   - the wavefront with 1 and 2 threads, and the reference;
#   - kernels for what the scene needs, and kernels that can do everything;
#   - sizes of the wave.
# Prints medians and spreads. DIRECTORY (default profiling/results) gets the same as summary.txt,
# every single value as raw.txt, and the report of one render, with its stages, as stages.txt.
# README.md in this directory says what is measured and why so.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")/.."

rounds=${1:-7}
directory=${2:-profiling/results}
program=target/release/wavepath
room=scenes/hexroom-exact.toml
depth=(--max-depth 16 --roulette-depth 5 --sampler independent)
waves=(64 256 1024 4096 16384 65536)

cargo build --release --quiet
mkdir -p "$directory"
raw=$directory/raw.txt
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# run SERIES SCENE OPTION...: renders once; adds "SERIES paths-per-CPU-second" to the raw values.
run() {
    local series=$1
    shift
    "$program" render "$@" "${depth[@]}" \
        --quiet --output "$scratch/image.png" --report "$scratch/report.json"
    # The report has one key per line; sections are indented by two spaces, phases by four.
    awk -v series="$series" '
        /^  "/ { section = $1 }
        /^    "/ { phase = $1 }
        section == "\"paths\":" && $1 == "\"count\":" { paths = $2 + 0 }
        section == "\"times\":" && phase == "\"render\":" && $1 == "\"cpu_seconds\":" { cpu = $2 + 0 }
        END {
            if (!(paths > 0 && cpu > 0)) { print "no figures in the report" > "/dev/stderr"; exit 1 }
            printf "%s %.0f\n", series, paths / cpu
        }
    ' "$scratch/report.json" >> "$raw"
}

# table TITLE SERIES...: median, extremes and spread of each series, and its ratio to the first.
table() {
    local title=$1
    shift
    awk -v title="$title" -v wanted="$*" '
        { value[$1, ++count[$1]] = $2 }
        END {
            printf "\n%-26s%12s%12s%12s%10s%10s\n", title, "median", "least", "most", "spread", "ratio"
            series_count = split(wanted, series, " ")
            for (s = 1; s <= series_count; s++) {
                name = series[s]
                n = count[name]
                for (i = 2; i <= n; i++) {
                    moving = value[name, i]
                    for (j = i - 1; j > 0 && value[name, j] > moving; j--)
                        value[name, j + 1] = value[name, j]
                    value[name, j + 1] = moving
                }
                least = value[name, 1]
                most = value[name, n]
                median = (value[name, int((n + 1) / 2)] + value[name, int(n / 2) + 1]) / 2
                if (s == 1) first = median
                printf "%-26s%12.0f%12.0f%12.0f%8.1f %%%10.3f\n", name, median, least, most,
                    100 * (most - least) / median, median / first
            }
        }
    ' "$raw"
}

measure() {
    : > "$raw"
    run warm-up "$room" --spp 16
    for ((round = 1; round <= rounds; round++)); do
        run wavefront-1-thread "$room" --spp 16 --threads 1
        run reference "$room" --spp 4 --threads 1 --width 200 --height 200 --integrator reference
        run wavefront-2-threads "$room" --spp 16 --threads 2
    done
    for ((round = 1; round <= rounds; round++)); do
        for scene in hexroom-exact cornell; do
            run "$scene-lean" "scenes/$scene.toml" --spp 16 --threads 1
            run "$scene-everything" "scenes/$scene.toml" --spp 16 --threads 1 --force-features
        done
    done
    for ((round = 1; round <= rounds; round++)); do
        for wave in "${waves[@]}"; do
            run "wave-$wave" "$room" --spp 16 --threads 1 --wave "$wave"
        done
    done
    "$program" render "$room" "${depth[@]}" --spp 16 --threads 1 \
        --output "$scratch/image.png" 2> /dev/null | grep -v '^wrote ' > "$directory/stages.txt"
}

summarise() {
    printf 'commit %s, %s\n' "$(git describe --always --dirty --abbrev=12)" "$(rustc --version)"
    printf '%s, %s logical cores, %s\n' \
        "$(awk -F': ' '/^model name/ { print $2; exit }' /proc/cpuinfo)" \
        "$(getconf _NPROCESSORS_ONLN)" "$(uname -srm)"
    printf 'load average before %s, after %s\n' "$load_before" "$(cut -d' ' -f1-3 /proc/loadavg)"
    printf '%s rounds; camera paths per CPU second of the process while it renders\n' "$rounds"
    table 'integrator' reference wavefront-1-thread wavefront-2-threads
    table 'features, hexroom-exact' hexroom-exact-everything hexroom-exact-lean
    table 'features, cornell' cornell-everything cornell-lean
    table 'wave' "${waves[@]/#/wave-}"
    printf '\none thread, by stage\n'
    awk '/^stage / { on = 1 } on && NF == 0 { exit } on' "$directory/stages.txt"
}

load_before=$(cut -d' ' -f1-3 /proc/loadavg)
measure
summarise | tee "$directory/summary.txt"
