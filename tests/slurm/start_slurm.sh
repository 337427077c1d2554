#!/usr/bin/env bash
# Start a Slurm of one node that lives in a folder of its own:
#
#   tests/slurm/start_slurm.sh FOLDER
#   export SLURM_CONF=FOLDER/slurm.conf PATH=FOLDER/bin:$PATH
#   tests/slurm/stop_slurm.sh FOLDER
#
# Needs slurmctld, slurmd and munged (Debian: slurm-wlm, munge), and no rights: munge has a key of
# its own, all talk over the loopback interface on free ports, and nothing is read from or written
# to the Slurm of the system. Jobs that use more memory than they asked for are killed.
set -euo pipefail
if [ $# != 1 ] || [ -e "$1/slurm.conf" ]; then
  echo "usage: start_slurm.sh FOLDER (a new one)" >&2
  exit 2
fi
PATH=$PATH:/usr/sbin:/sbin
mkdir -p "$1"
folder=$(cd "$1" && pwd)
chmod 755 "$folder"
mkdir "$folder/state" "$folder/spool" "$folder/bin"

free_ports() {
  python3 - << 'PYTHON'
import socket

taken = [socket.socket() for _ in range(2)]
for one in taken:
    one.bind(("127.0.0.1", 0))
print(*(one.getsockname()[1] for one in taken))
PYTHON
}

host=$(hostname -s)
user=$(id -un)
memory=$(($(awk '/^MemTotal/ {print $2}' /proc/meminfo) / 1024))
read -r controller_port node_port < <(free_ports)

(umask 077 && head -c 1024 /dev/urandom > "$folder/munge.key")
cat > "$folder/slurm.conf" << CONF
ClusterName=imubench
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$controller_port
SlurmdPort=$node_port
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
SlurmUser=$user
SlurmdUser=$user
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
KillWait=2
MinJobAge=3600
SlurmdParameters=config_overrides
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 RealMemory=$memory State=UNKNOWN
PartitionName=tests Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf

# Snakemake starts srun on the node without SLURM_CONF.
cat > "$folder/bin/srun" << SRUN
#!/bin/sh
SLURM_CONF='$SLURM_CONF' exec '$(command -v srun)' "\$@"
SRUN
chmod +x "$folder/bin/srun"

munged --key-file="$folder/munge.key" --socket="$folder/munge.socket" \
  --pid-file="$folder/munged.pid" --log-file="$folder/munged.log" --seed-file="$folder/munge.seed"
slurmctld -c
slurmd -c

for _ in $(seq 100); do
  if [ "$(sinfo --noheader --format=%t 2> /dev/null)" = idle ]; then exit 0; fi
  sleep 0.2
done
echo "Slurm does not answer:" >&2
tail -n 20 "$folder"/slurm*.log "$folder"/munged.log >&2
exit 1
