#!/usr/bin/env bash
# The table of `wavepath stability` by both lane widths: a build for this machine (16 lanes with AVX-512,
# else 8) and one for plain x86-64 (8 lanes, no AVX). Arguments go to both. Findings as JSON lie in
# target/stability-*.json.
set -euo pipefail
cd "$(dirname "$0")/.."

status=0
run() {
    local name=$1 folder=$2
    shift 2
    cargo build --release --quiet --target-dir "$folder"
    "$folder/release/wavepath" stability --quiet --json "target/stability-$name.json" "$@" || status=1
}
run native target "$@"
RUSTFLAGS="-C target-cpu=x86-64" run baseline target/baseline "$@"
exit $status
