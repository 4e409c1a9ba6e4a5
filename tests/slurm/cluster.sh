# A private Slurm cluster on the loopback address: one node with two processors and two GPUs that are none. Sourced by `run`.
# Nothing is read from or written to /etc; its configuration, key, sockets, logs and spool lie in the folder it is given.

# The daemons are in /usr/sbin, which a user's PATH may lack.
PATH="$PATH:/usr/sbin:/sbin"

# Debian's name of each program that is missing.
cluster_missing_packages() {
    command -v munged >/dev/null || echo munge
    command -v slurmctld >/dev/null || echo slurmctld
    command -v slurmd >/dev/null || echo slurmd
    command -v sbatch >/dev/null || echo slurm-client
}

# A port that nobody listens to, from the range of temporary ones.
free_port() {
    local port
    for _ in {1..50}; do
        port=$((32768 + RANDOM % 28000))
        if ! (: <"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then
            echo "$port"
            return
        fi
    done
    return 1
}

write_configuration() {
    local folder=$1 host user
    host="$(uname -n)"
    host="${host%%.*}" # Slurm compares short names.
    user="$(id -un)"
    cat >"$folder/slurm.conf" <<END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$user
SlurmdUser=$user
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
AuthType=auth/munge
AuthInfo=socket=$folder/run/munge
CredType=cred/munge
StateSaveLocation=$folder/spool/slurmctld
SlurmdSpoolDir=$folder/spool/%n
SlurmctldPidFile=$folder/run/slurmctld.pid
SlurmdPidFile=$folder/run/slurmd.pid
SlurmctldLogFile=$folder/log/slurmctld
SlurmdLogFile=$folder/log/slurmd
# Nothing that needs cgroups, systemd, or another machine.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
MailProg=/bin/true
ReturnToService=2
# Two processors, whatever the machine has.
SlurmdParameters=config_overrides
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/builtin
GresTypes=gpu
KillWait=30
NodeName=node NodeHostname=$host NodeAddr=127.0.0.1 CPUs=2 RealMemory=500 Gres=gpu:2
PartitionName=all Nodes=node Default=YES MaxTime=INFINITE State=UP
END
    # A GPU must be a device, and any will do.
    printf 'NodeName=node Name=gpu File=%s Flags=nvidia_gpu_env\n' /dev/null /dev/zero >"$folder/gres.conf"
}

# Starts the cluster in a new folder; SLURM_CONF leads every command to it.
start_cluster() {
    local folder=$1
    mkdir -p "$folder"/{run,key,log,spool/slurmctld,spool/node}
    chmod 755 "$folder" "$folder/run" # Munge wants its socket to be reachable for all.
    chmod 700 "$folder/key"
    head -c 128 /dev/urandom >"$folder/key/munge"
    chmod 400 "$folder/key/munge"
    write_configuration "$folder"
    export SLURM_CONF="$folder/slurm.conf"
    munged --force --key-file="$folder/key/munge" --socket="$folder/run/munge" --pid-file="$folder/run/munged.pid" \
        --log-file="$folder/log/munged" --seed-file="$folder/key/seed" --num-threads=2 2>>"$folder/log/start"
    slurmctld -c -f "$SLURM_CONF" 2>>"$folder/log/start"
    slurmd -c -N node -f "$SLURM_CONF" 2>>"$folder/log/start"
    for _ in {1..100}; do
        [[ "$(sinfo --noheader --format=%t 2>/dev/null)" == idle ]] && return
        sleep 0.2
    done
    echo "the cluster did not start" >&2
    show_logs "$folder"
    return 1
}

show_logs() {
    [[ -d "$1/log" ]] || return 0
    tail -n 25 "$1"/log/* >&2 || true
}

# Ends the daemons, those that started at least, and waits until they are gone.
stop_cluster() {
    local folder=$1 name pid
    [[ -f "$folder/run/slurmctld.pid" ]] && scancel --quiet --user="$(id -un)" 2>/dev/null
    for name in slurmd slurmctld munged; do
        pid="$(cat "$folder/run/$name.pid" 2>/dev/null)" || continue
        kill "$pid" 2>/dev/null || continue
        for _ in {1..100}; do
            kill -0 "$pid" 2>/dev/null || continue 2
            sleep 0.1
        done
        kill -KILL "$pid" 2>/dev/null
    done
}
