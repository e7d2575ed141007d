#!/usr/bin/env bash
# The study of .test through a Slurm of one node and on this machine by itself; then every result is compared, byte by byte.
# run.sh [TARGET]; `validate` by default. Needs root, slurm-wlm, munge, and the program with its extra `cluster`.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
target="${1:-validate}"
place="$(mktemp -d)"
trap '"$here/one_node.sh" stop "$place/slurm"' EXIT
"$here/one_node.sh" start "$place/slurm"

for way in alone cluster; do
    mkdir "$place/$way"
    cp -r "$here/../../.test/config" "$place/$way"
done
# Without accounting only squeue knows how a job has ended.
(cd "$place/cluster" && time python -m repose run "$target" --profile profiles/slurm --jobs "$(nproc)" \
    --slurm-no-account --slurm-status-command squeue)
(cd "$place/alone" && time python -m repose run "$target" --cores "$(nproc)")
"$here/same_bits.sh" "$place/alone/results" "$place/cluster/results"
python "$here/overhead.py" "$place/cluster"
