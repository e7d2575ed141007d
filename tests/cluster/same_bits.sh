#!/usr/bin/env bash
# Whether two folders of results hold the same files: same_bits.sh ONE OTHER. Times, logs and locks are left out.
set -euo pipefail

hashes() {
    (cd "$1" && find . -type f -not -path './logs/*' -not -path './benchmarks/*' -not -path '*/timings/*' \
        -not -name '.*' -print0 | sort -z | xargs -0 sha256sum)
}

diff <(hashes "$1") <(hashes "$2")
echo "the same: $(hashes "$1" | wc -l) files"
