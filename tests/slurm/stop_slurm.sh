#!/usr/bin/env bash
# Stop the Slurm that start_slurm.sh has started in a folder, with its jobs, and remove the folder.
set -uo pipefail
if [ $# != 1 ] || [ ! -e "$1/slurm.conf" ]; then
  echo "usage: stop_slurm.sh FOLDER (of start_slurm.sh)" >&2
  exit 2
fi
folder=$(cd "$1" && pwd)
export SLURM_CONF=$folder/slurm.conf

timeout 10 scancel --quiet --user "$(id -un)" 2> /dev/null
for _ in $(seq 50); do
  if [ -z "$(timeout 5 squeue --noheader 2> /dev/null)" ]; then break; fi
  sleep 0.1
done
pids=()
for daemon in slurmd slurmctld munged; do
  pid=$(cat "$folder/$daemon.pid" 2> /dev/null) && kill "$pid" 2> /dev/null && pids+=("$pid")
done
for pid in "${pids[@]}"; do
  for _ in $(seq 50); do
    if ! kill -0 "$pid" 2> /dev/null; then continue 2; fi
    sleep 0.1
  done
  kill -9 "$pid" 2> /dev/null
done
rm -rf "$folder"
