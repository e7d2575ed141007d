#!/usr/bin/env bash
# A study through a Slurm of one node and on this machine by itself; then every result is compared, byte by byte.
# run.sh [TARGET [STUDY]]: `validate` of the study of .test by default; run.sh validate toy.yaml is that of another program.
# Needs root, slurm-wlm, munge, and the program with its extra `cluster`.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
target="${1:-validate}"
study="${2:-}"
place="$(mktemp -d)"
trap '"$here/one_node.sh" stop "$place/slurm"' EXIT
"$here/one_node.sh" start "$place/slurm"

files=()
for way in alone cluster; do
    mkdir "$place/$way"
    if [ -z "$study" ]; then
        cp -r "$here/../../.test/config" "$place/$way"
    else
        cp "$here/$study" "$here/toy.py" "$place/$way"
        files=(--configfile "$study")
    fi
done
# Without accounting only squeue knows how a job has ended.
(cd "$place/cluster" && time python -m repose run "$target" "${files[@]}" --profile profiles/slurm --jobs "$(nproc)" \
    --slurm-no-account --slurm-status-command squeue)
(cd "$place/alone" && time python -m repose run "$target" "${files[@]}" --cores "$(nproc)")
"$here/same_bits.sh" "$place/alone/results" "$place/cluster/results"
python "$here/overhead.py" "$place/cluster"
