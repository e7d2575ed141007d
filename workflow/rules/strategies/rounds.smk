# Rounds of the refinement: inputs of its rules.
REFINED = f"{RESULTS}/refined"


def runs_before(wildcards):
    """Folders of the design and of the rounds before one."""
    return [RESULTS, *(f"{REFINED}/round_{k}" for k in range(int(wildcards.round)))]


def round_seeds(wildcards):
    """Seeds of a job of a round."""
    jobs = rounds.jobs(config["refine"], int(wildcards.batch.removeprefix("round_")))
    return {sample: seeds for sample, _, seeds in jobs}[int(wildcards.job)]


def round_numbers(batch):
    """Samples of a round by the name of its folder."""
    jobs = rounds.jobs(config["refine"], int(batch.removeprefix("round_")))
    return [sample for sample, _, _ in jobs]


def files_of_rounds(wildcards):
    """Every file of the rounds of the loop, as far as they are known."""
    files = []
    for k in range(len(verdicts(wildcards))):
        batch = {"strategy": "refined", "batch": f"round_{k}"}
        made = [*rules.batch_pour.output, *rules.measure_batch_runs.output]
        jobs = round_numbers(batch["batch"])
        files += expand(made, **batch, runs=folders_of_targets(), job=jobs)
        files += expand(rules.batch_dataset.output, **batch)
        files += expand(
            [*rules.refine_propose.output, *rules.refine_round.output], round=k
        )
    return files


def verdicts(wildcards):
    """Verdicts of all rounds of the loop, as far as they are known; each decides whether another follows."""
    paths, before = [], None
    for k in range(config["refine"]["rounds"] + 1):
        paths.append(checkpoints.refine_round.get(round=k).output.verdict)
        with open(paths[-1]) as file:
            verdict_of_round = json.load(file)
        if not rounds.goes_on(verdict_of_round, before):
            break
        before = verdict_of_round
    return paths
