#!/usr/bin/env bash
# A Slurm cluster of this machine alone, in a folder of its own: one_node.sh start|stop FOLDER.
# Needs root, and Debian's slurm-wlm and munge. Jobs find their cluster by /etc/slurm/slurm.conf only, since the executor
# hides the variables of Slurm from them: it is a link into the folder, and is refused where there is a file already.
set -euo pipefail
action="$1"
mkdir -p "$2"
folder="$(cd "$2" && pwd)"
export SLURM_CONF="$folder/slurm.conf"
known=/etc/slurm/slurm.conf

stop() {
    [ "$(readlink "$known")" != "$SLURM_CONF" ] || rm "$known"
    for name in slurmd slurmctld munged; do
        [ ! -s "$folder/$name.pid" ] || kill "$(cat "$folder/$name.pid")" 2> /dev/null || true
    done
}

start() {
    if [ -e "$known" ]; then
        echo "$known is there: this machine has a cluster" >&2
        return 1
    fi
    ln -sf "$SLURM_CONF" "$known"
    chmod 755 "$folder"
    mkdir -p "$folder/state" "$folder/spool" "$folder/munge"
    chmod 755 "$folder/munge"
    head -c 1024 /dev/urandom > "$folder/munge/key"
    chmod 600 "$folder/munge/key"
    munged --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" \
        --pid-file="$folder/munged.pid" --log-file="$folder/munge/log" --seed-file="$folder/munge/seed"
    local host memory
    host="$(hostname -s)"
    memory="$(awk '/MemTotal/ {print int($2 / 1024 * 0.9)}' /proc/meminfo)"
    cat > "$SLURM_CONF" << CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CryptoType=crypto/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
ReturnToService=2
MinJobAge=86400
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
    slurmctld -c
    slurmd -c
    for _ in $(seq 60); do
        if sinfo -h -o %T | grep -qE "idle|mixed|allocated"; then
            return
        fi
        sleep 1
    done
    echo "the node is not up: $folder/slurmd.log" >&2
    tail -5 "$folder/slurmctld.log" "$folder/slurmd.log" >&2
    return 1
}

case "$action" in
    start) start ;;
    stop) stop ;;
    *) echo "usage: one_node.sh start|stop FOLDER" >&2 && exit 2 ;;
esac
