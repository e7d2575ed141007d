"""Arguments of the command line: the verbs with their options, and what the options of `heap` mean."""

import argparse
import csv
from pathlib import Path

from repose import settings
from repose.errors import InputError
from repose.parameters import LABELS, PARAMETERS, PHYSICAL_LIMITS

CONFIG = "config/config.yaml"
PUBLISHED = Path("resources/published")
# Files that the verb posterior reads, and where they lie.
POSTERIOR_FILES = {
    "network": "results/network/network.json",
    "metrics": "results/network/metrics.json",
    "predictions": "results/network/predictions.csv",
    "dataset": "results/dataset.csv",
    "runs": "results/runs.csv",
    "feasible": "results/miga/feasible.csv",
    "table3": str(PUBLISHED / "table3.csv"),
}
# Files that the comparisons on the pool read, and where they lie.
COMPARISON_FILES = {
    f"{points}_{table}": f"results/{place}{table}.csv"
    for points, place in (("main", ""), ("pool", "pool/"), ("fresh", "pool/fresh_"))
    for table in ("dataset", "runs")
}


def parser():
    """The parser of all verbs."""
    top = argparse.ArgumentParser(
        prog="python -m repose",
        description="Calibrates the contact parameters of a discrete element model from a pile of berries. "
        "Each verb is one step of the method; `snakemake --cores 2` runs them all in order.",
        epilog="example: python -m repose heap --set mus_gg=0.6 --seed 1 --out results/try",
    )
    verbs = top.add_subparsers(title="verbs", metavar="VERB", required=True)
    _add_inputs(verbs)
    _add_heap(verbs)
    _add_drum(verbs)
    _add_shape_study(verbs)
    _add_measuring(verbs)
    _add_calibration(verbs)
    _add_uncertainty(verbs)
    _add_inversion(verbs)
    _add_responses(verbs)
    _add_refinement(verbs)
    _add_comparisons(verbs)
    _add_pictures(verbs)
    _add_services(verbs)
    return top


def _verb(verbs, name, summary, example, out=None, config=True):
    """A sub-parser with the options that most verbs share."""
    sub = verbs.add_parser(
        name, help=summary, description=summary[0].upper() + summary[1:] + ".", epilog=f"example: {example}"
    )
    sub.set_defaults(verb=name)
    if config:
        sub.add_argument("--config", default=CONFIG, help=f"YAML or JSON configuration ({CONFIG})")
    if out:
        sub.add_argument(
            "--out", default=out, help=f"{'file' if Path(out).suffix else 'folder'} to write ({out})"
        )
    return sub


def _add_inputs(verbs):
    sub = _verb(
        verbs,
        "berry",
        "sizes to sphericity, compression tests to moduli (Eq. 1-4); or a mesh from three axes and a mass",
        "python -m repose berry --axes 17.1 11.37 9.88 --mass-g 1.0 --density 840.47 --stl results/crop.stl",
        out="results/berry",
    )
    sub.add_argument(
        "--table1", default=str(PUBLISHED / "table1.csv"), help="published statistics to compare with"
    )
    sub.add_argument("--axes", type=float, nargs=3, metavar="MM", help="build a mesh instead: its three axes")
    sub.add_argument("--stl", help="the mesh file to build; with --axes and --mass-g")
    sub.add_argument("--mass-g", type=float, help="mass of the berry to build, which makes it full or lean")
    sub.add_argument("--density", type=float, help="its density in kg/m3 (the configuration's)")
    sub.add_argument("--taper", type=float, default=0.0, help="how much wider at one end, over the width (0)")
    sub.add_argument("--wrinkles", type=int, default=0, help="grooves along it (0)")
    sub.add_argument("--wrinkle-depth-mm", type=float, default=0.0, help="their depth (0)")
    sub = _verb(
        verbs,
        "shape",
        "mesh and particle of the berry: volume, mass, inertia, deviation from the mesh",
        "python -m repose shape --berry results/berry/berry.json",
        out="results/berry",
    )
    sub.add_argument("--berry", default="results/berry/berry.json", help="what the verb berry wrote")
    _verb(
        verbs,
        "design",
        "Latin hypercube design of the six contact parameters",
        "python -m repose design --out results/design",
        out="results/design",
    )
    _verb(
        verbs,
        "pool_design",
        "points of the pool that the comparisons share, to train on and to judge by",
        "python -m repose pool_design --out results/pool",
        out="results/pool",
    )


def _add_heap(verbs):
    sub = _verb(
        verbs,
        "heap",
        "pour berries through the funnel, measure the pile; one parameter set, one seed or several",
        "python -m repose heap --set e_gg=0.203 --set mus_gg=0.642 --seed 1 --out results/try --json",
        out="results/try",
    )
    _add_pour(sub)
    sub.add_argument("--json", action="store_true", help="print the result as JSON")
    sub = _verb(
        verbs,
        "pour",
        "pour as the verb heap does and write where the berries lie, to be measured by measure_heap",
        "python -m repose pour --set mus_gg=0.642 --seed 1 --out results/try",
        out="results/try",
    )
    _add_pour(sub)
    sub = _verb(
        verbs,
        "measure_heap",
        "measure the piles of saved pours, without pouring again",
        "python -m repose measure_heap results/try/heap.pours.json --out results/try",
    )
    sub.add_argument("pours", nargs="+", help="NAME.pours.json files of pour or heap, NAME.npz beside them")
    sub.add_argument("--out", help="folder for NAME.json (that of the pours)")
    _add_berry(sub)


def _add_pour(sub):
    """What the verbs heap and pour share."""
    _add_parameters(sub)
    sub.add_argument("--seeds", type=int, metavar="N", help="N seeds of the study's own, instead of --seed")
    sub.add_argument(
        "--purpose",
        choices=tuple(settings.PURPOSES),
        default="design",
        help="which of the study's streams --seeds draws from (design)",
    )
    sub.add_argument("--trajectory", type=float, metavar="S", help="also write positions every S seconds")


def _add_parameters(sub):
    """What every simulation takes: a parameter set, seeds, the berry."""
    sub.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"a contact parameter: {', '.join(PARAMETERS)}; one that is not set has the centre of its range",
    )
    sub.add_argument("--samples", help="CSV with the columns sample and the six, instead of --set")
    sub.add_argument("--sample", type=int, help="number in the column sample; also the name of the files")
    sub.add_argument(
        "--seed", type=int, action="append", help="seed of a run (1); may be given several times"
    )
    _add_berry(sub)


def _add_berry(sub):
    """The berry and its shape."""
    sub.add_argument("--berry", help="berry.json; made from the configuration if not given")
    sub.add_argument("--particle", help="particle.json; made from the configuration if not given")


def _add_drum(verbs):
    sub = _verb(
        verbs,
        "drum",
        "let berries rest in a drum and turn it until its bed slips; one parameter set, one seed or several",
        "python -m repose drum --set mus_gg=0.642 --set mus_gp=0.483 --seed 1 --out results/try",
        out="results/try",
    )
    _add_parameters(sub)
    sub.add_argument("--trajectory", action="store_true", help="also write every frame of the record")
    sub.add_argument("--json", action="store_true", help="print the results as JSON")
    sub.set_defaults(seeds=None)
    sub = _verb(
        verbs,
        "drum_tables",
        "runs of the drum to tables: angles, first slip, slipping layer, with standard errors",
        "python -m repose drum_tables results/drum/turn_*.json --out results/drum",
        out="results/drum",
        config=False,
    )
    sub.add_argument("runs", nargs="+", help="JSON files that the verb drum wrote")


def _add_shape_study(verbs):
    sub = _verb(
        verbs,
        "shape_cell",
        "pour and measure one combination of particle and filling at the published or the designed parameters",
        "python -m repose shape_cell --cell published-smooth-open_cone",
        out="results/shape/cells",
    )
    sub.add_argument("--cell", required=True, help="KIND-PARTICLE-FILLING of the section shape_study")
    sub.add_argument("--berry", default="results/berry/berry.json", help="what the verb berry wrote")
    sub.add_argument("--samples", default="results/design/samples.csv", help="what the verb design wrote")
    sub = _verb(
        verbs,
        "shape_study",
        "particles, fillings and definitions of the angle beside the published piles: tables and the choice",
        "python -m repose shape_study results/shape/cells/*.csv",
        out="results/shape",
    )
    sub.add_argument("cells", nargs="+", help="CSV files of shape_cell")


def _add_measuring(verbs):
    sub = _verb(
        verbs,
        "measure",
        "angle of repose and Height of the pile in a picture, a photograph or a silhouette",
        "python -m repose measure pile.jpg --mm-per-pixel 0.1",
    )
    sub.add_argument("picture", help="side view of a pile: PNG, JPEG, TIFF or BMP")
    sub.add_argument("--mm-per-pixel", type=float, required=True, help="scale of the picture")
    sub.add_argument("--overlay", help="picture with the fitted lines (beside the picture, NAME_overlay.png)")
    sub.add_argument("--berry", help="berry.json; its axes are those of the configuration if not given")
    sub.add_argument(
        "--json", action="store_true", help="print left_deg, right_deg, aor_deg, height_mm and more as JSON"
    )
    sub = _verb(
        verbs,
        "silhouette",
        "side view of a simulated pile as a picture, dark on light",
        "python -m repose silhouette results/try/heap.npz --particle results/berry/particle.json",
        out="silhouette.png",
    )
    sub.add_argument("heap", help=".npz file that the verb pour or heap wrote; its first seed is shown")
    sub.add_argument("--particle", required=True, help="particle.json of that heap")
    sub.add_argument("--azimuth", type=float, default=0.0, help="direction of view in degrees (0)")

    sub = _verb(
        verbs,
        "measurement_study",
        "compare the definitions of the angle: bias on known shapes, noise, signal over the design",
        "python -m repose measurement_study results/heaps/???.npz"
        " --representative results/validation/heaps/106.npz",
        out="results/measurement_study",
    )
    sub.add_argument("heaps", nargs="+", help=".npz files of the design's pours, NAME.pours.json beside them")
    sub.add_argument(
        "--representative", required=True, help=".npz file of the published representative solution"
    )
    sub.add_argument("--shapes", type=int, default=8, help="piles of each known shape and angle (8)")
    _add_berry(sub)


def _add_calibration(verbs):
    sub = _verb(
        verbs,
        "dataset",
        "heaps to one table: responses with standard errors, failures with their reasons",
        "python -m repose dataset results/heaps/???.json --out results",
        out="results",
        config=False,
    )
    sub.add_argument("heaps", nargs="+", help="JSON files that the verb measure_heap or heap wrote")
    sub.add_argument("--samples", default="results/design/samples.csv", help="the design")
    sub.add_argument("--prefix", default="", help="put before the names of the tables")
    sub = _verb(
        verbs,
        "network",
        "train the BP network with Bayesian regularisation",
        "python -m repose network --dataset results/dataset.csv --runs results/runs.csv",
        out="results/network",
    )
    sub.add_argument("--dataset", default="results/dataset.csv", help="what the verb dataset wrote")
    sub.add_argument("--runs", default="results/runs.csv", help="what the verb dataset wrote: single runs")
    sub = _verb(
        verbs,
        "miga",
        "invert the network with the multi-island genetic algorithm (Eq. 11-12)",
        "python -m repose miga --network results/network/network.json",
        out="results/miga",
    )
    sub.add_argument("--network", default="results/network/network.json", help="what the verb network wrote")
    sub.add_argument("--table3", default=str(PUBLISHED / "table3.csv"), help="published intervals")
    _add_support(sub)
    sub = _verb(
        verbs,
        "solutions",
        "list what to simulate again: representative solution, others spread over the cloud, published ones",
        "python -m repose solutions --feasible results/miga/feasible.csv",
        out="results/validation",
    )
    sub.add_argument("--feasible", default="results/miga/feasible.csv", help="what the verb miga wrote")
    sub = _verb(
        verbs,
        "validate",
        "predicted beside simulated: our solutions (Table 4), and the published ones in our simulator",
        "python -m repose validate results/validation/heaps/???.json",
        out="results/validation",
    )
    sub.add_argument("heaps", nargs="+", help="JSON files that measure_heap wrote, one for each solution")
    sub.add_argument("--solutions", default="results/validation/solutions.csv", help="what `solutions` wrote")
    _add_support(sub)


def _add_support(sub):
    """The samples that tell an extrapolation."""
    sub.add_argument("--dataset", help="dataset.csv; with it solutions beyond its samples carry a warning")


def _add_uncertainty(verbs):
    sub = _verb(
        verbs,
        "noise",
        "variance of both responses within and between samples, what seeds buy, what a predictor can reach",
        "python -m repose noise --runs results/runs.csv",
        out="results/noise",
    )
    sub.add_argument("--runs", default="results/runs.csv", help="what the verb dataset wrote: single runs")
    sub = _verb(
        verbs,
        "posterior",
        "posterior of the six parameters given the physical piles, with what they do not determine",
        "python -m repose posterior --network results/network/network.json",
        out="results/posterior",
    )
    for key, path in POSTERIOR_FILES.items():
        sub.add_argument(f"--{key}", default=path, help=f"({path})")
    sub = _verb(
        verbs,
        "sensitivity",
        "Sobol indices of both responses on the network, with intervals, and main effects",
        "python -m repose sensitivity --network results/network/network.json",
        out="results/sensitivity",
    )
    sub.add_argument("--network", default="results/network/network.json", help="what the verb network wrote")


def _add_inversion(verbs):
    sub = _verb(
        verbs,
        "compare_search",
        "searches beside each other on the trained network: evaluations, and which solutions they find",
        "python -m repose compare_search --network results/network/network.json",
        out="results/comparison",
    )
    sub.add_argument("--network", default="results/network/network.json", help="what the verb network wrote")
    sub = _verb(
        verbs,
        "compare_whole",
        "the method beside a response surface with a local search, for equal numbers of simulations",
        "python -m repose compare_whole --dataset results/dataset.csv --runs results/runs.csv",
        out="results/comparison",
    )
    sub.add_argument(
        "--dataset", nargs="+", default=["results/dataset.csv"], help="what the verb dataset wrote"
    )
    sub.add_argument(
        "--runs", nargs="+", default=["results/runs.csv"], help="as many: single runs of the same"
    )


def _add_responses(verbs):
    sub = _verb(
        verbs,
        "measure_responses",
        "more responses of saved pours: profile, packing, loose berries, discharge time",
        "python -m repose measure_responses results/heaps/???.pours.json --runs results/runs.csv",
        out="results/responses/runs.csv",
    )
    sub.add_argument("pours", nargs="+", help="NAME.pours.json files of the verb pour, NAME.npz beside them")
    sub.add_argument("--runs", default="results/runs.csv", help="what the verb dataset wrote: single runs")
    _add_berry(sub)
    sub = _verb(
        verbs,
        "drum_design",
        "a sample of the design in the rotating drum, with seeds of its own",
        "python -m repose drum_design --samples results/design/samples.csv --sample 1",
        out="results/responses/drum",
    )
    sub.add_argument("--samples", default="results/design/samples.csv", help="what the verb design wrote")
    sub.add_argument("--sample", type=int, required=True, help="number in the column sample")
    _add_berry(sub)
    sub.set_defaults(set=[])
    sub = _verb(
        verbs,
        "second_responses",
        "how far each further response of the pile narrows the posterior of the six parameters",
        "python -m repose second_responses --runs results/responses/runs.csv --dataset results/dataset.csv",
        out="results/responses",
    )
    sub.add_argument("--runs", default="results/responses/runs.csv", help="what measure_responses wrote")
    sub.add_argument("--dataset", default="results/dataset.csv", help="what the verb dataset wrote")
    sub.add_argument("--drum", nargs="+", help="files of drum_design, to judge the drum as well")
    sub.add_argument("--drum-runs", default="results/drum/runs.csv", help="what the verb drum_tables wrote")


def _add_refinement(verbs):
    sub = _verb(
        verbs,
        "refine_data",
        "add the samples of the rounds so far to those of the design, for the next fit",
        "python -m repose refine_data results/refined/round_0 --out results/refined/round_1",
        out="results/refined/round_1",
        config=False,
    )
    sub.add_argument("rounds", nargs="+", help="folders of the rounds: dataset.csv and runs.csv of their own")
    sub.add_argument("--dataset", default="results/dataset.csv", help="of the design")
    sub.add_argument("--runs", default="results/runs.csv", help="of the design: single runs")
    sub = _verb(
        verbs,
        "refine_search",
        "set the refitted network right near the last proposal and search there",
        "python -m repose refine_search --near results/refined/round_0/proposal.csv",
        out="results/refined/round_1/miga",
    )
    refined = "results/refined/round_1"
    sub.add_argument("--network", default=f"{refined}/network/network.json", help="the refitted network")
    sub.add_argument("--dataset", default=f"{refined}/data/dataset.csv", help="what it was fitted to")
    sub.add_argument("--near", default="results/refined/round_0/proposal.csv", help="the last proposal")
    sub.add_argument("--table3", default=str(PUBLISHED / "table3.csv"), help="published intervals")
    sub = _verb(
        verbs,
        "refine_propose",
        "list what a round simulates: the representative solution in blocks of seeds, and its neighbours",
        "python -m repose refine_propose --round 0",
        out="results/refined/round_0",
    )
    sub.add_argument("--round", type=int, required=True, help="its number, from 0")
    sub.add_argument("--feasible", default="results/miga/feasible.csv", help="what the search wrote")
    sub.add_argument("--network", default="results/network/network.json", help="the network that it searched")
    sub = _verb(
        verbs,
        "refine_judge",
        "a round's proposal beside the target: outcome, reason, and all its points predicted beside simulated",
        "python -m repose refine_judge --out results/refined/round_0",
        out="results/refined/round_0",
    )
    for key in ("proposal", "dataset", "runs"):
        path = f"results/refined/round_0/{key}.csv"
        sub.add_argument(f"--{key}", default=path, help=f"of the round ({path})")
    sub = _verb(
        verbs,
        "refine_tables",
        "all rounds in one table, why the loop stopped, and what may be claimed",
        "python -m repose refine_tables results/refined/round_0/verdict.json",
        out="results/refined",
    )
    sub.add_argument("verdicts", nargs="+", help="JSON files that refine_judge wrote")


def _add_comparisons(verbs):
    for name, summary in (
        (
            "compare_accuracy",
            "accuracy of the network at points that no fit has seen, over what it is trained on",
        ),
        (
            "compare_surrogates",
            "surrogates at equal budgets of simulations, judged at points that no fit has seen",
        ),
        (
            "compare_sampling",
            "designs, and points against seeds: repetitions emulated from the pool, real ones beside",
        ),
    ):
        sub = _verb(verbs, name, summary, f"python -m repose {name}", out="results/comparison")
        for key, path in COMPARISON_FILES.items():
            sub.add_argument(f"--{key.replace('_', '-')}", default=path, help=f"({path})")


def _add_pictures(verbs):
    sub = _verb(
        verbs,
        "figure",
        "draw one figure from the files that it shows",
        "python -m repose figure convergence --input history=results/miga/history.csv --out convergence.png",
        out="figure.png",
    )
    sub.add_argument("name", help="name of the figure, such as figure13")
    sub.add_argument("--input", action="append", default=[], metavar="NAME=PATH", help="a file that it shows")
    sub = _verb(
        verbs,
        "film",
        "animation of a pour, or of a drum",
        "python -m repose film results/try/heap_trajectory_1.npz --particle results/berry/particle.json",
        out="pour.gif",
    )
    sub.add_argument("trajectory", help=".npz file that `heap --trajectory` or `drum --trajectory` wrote")
    sub.add_argument("--particle", required=True, help="particle.json of that run")
    sub.add_argument("--drum", action="store_true", help="it is that of a drum")
    sub = _verb(
        verbs,
        "table",
        "a CSV table as a page to read",
        "python -m repose table results/validation/table4.csv --title 'Table 4' --out table4.html",
        out="table.html",
    )
    sub.add_argument("csv", help="the table")
    sub.add_argument("--title", required=True, help="headline of the page")


def _add_services(verbs):
    sub = _verb(
        verbs,
        "bench",
        "microseconds a step of the settled pile and seconds of a whole pour for the particles of the shape study, "
        "and how fast this machine is",
        "python -m repose bench --json",
    )
    sub.add_argument("--json", action="store_true", help="print as JSON")
    sub = _verb(
        verbs,
        "check",
        "check a configuration and tell what a run of it would take",
        "python -m repose check --config config/paper.yaml",
    )
    sub.add_argument("--cores", type=int, default=2, help="cores of the run (2)")
    sub = _verb(
        verbs,
        "verify",
        "run the simulator's verification suite: known answers beside its own",
        "python -m repose verify --out results/verification --case chung1",
        out="results/verification",
    )
    sub.add_argument(
        "--case", action="append", metavar="NAME", help="run this case; may be given several times"
    )
    sub.add_argument("--all", action="store_true", help="run the expensive cases too (convergence)")
    sub.add_argument(
        "--hits", type=int, default=10_000, help="impacts of each kind in the energy cases (10000)"
    )
    sub.add_argument(
        "--seeds", type=int, default=2, help="pours of each time step in the case convergence (2)"
    )
    sub = _verb(
        verbs,
        "snapshot",
        "copy the tables and pictures of a finished study, without its pours",
        "python -m repose snapshot results --out results/published/mine",
        out="results/published/mine",
        config=False,
    )
    sub.add_argument("results", help="folder of the finished study")


def parameters(args, ranges):
    """The six parameters from --set, the centre of its range for the others; or from a row of --samples."""
    given = {name: _number(text, name) for name, text in pairs(args.set, "--set").items()}
    if args.samples:
        if given or args.sample is None:
            raise InputError(
                "command line", "--samples", args.samples, "together with --sample, without --set"
            )
        given = _row(args.samples, args.sample)
    elif args.sample is not None:
        raise InputError("command line", "--sample", args.sample, "together with --samples")
    for name, value in given.items():
        if name not in PARAMETERS:
            known = ", ".join(f"{key} ({LABELS[key]})" for key in PARAMETERS)
            raise InputError("command line", f"--set {name}", value, f"a parameter of {known}")
        low, high = PHYSICAL_LIMITS[name]
        if not low <= value <= high or value == float("inf"):
            limit = f"{low:g} to {high:g}" if high < float("inf") else f"a finite number of at least {low:g}"
            raise InputError(args.samples or "command line", name, value, limit)
    return {name: given.get(name, round(sum(ranges[name]) / 2, 12)) for name in PARAMETERS}


def _row(path, number):
    """The parameters of a sample in a CSV that has the column sample."""
    if not Path(path).is_file():
        raise InputError(path, "file", None, "an existing CSV file")
    with Path(path).open(encoding="utf-8", newline="") as lines:
        reader = csv.DictReader(lines)
        columns = reader.fieldnames or []
        for name in ("sample", *PARAMETERS):
            if name not in columns:
                raise InputError(
                    path, "header", ",".join(columns), f"columns sample, {', '.join(PARAMETERS)}"
                )
        rows = {row["sample"]: row for row in reader}
    if str(number) not in rows:
        raise InputError(path, "sample", number, f"one of {len(rows)}: {', '.join(list(rows)[:3])}, ...")
    source = f"{path}, sample {number}"
    return {name: _number(rows[str(number)][name], name, source) for name in PARAMETERS}


def pairs(entries, option):
    """NAME=VALUE entries as a dict."""
    found = {}
    for entry in entries:
        name, equals, value = entry.partition("=")
        if not equals or not name or not value or name in found:
            raise InputError("command line", option, entry, "NAME=VALUE, each name once")
        found[name] = value
    return found


def _number(text, name, source="command line"):
    """A number, or InputError."""
    try:
        return float(text)
    except ValueError:
        raise InputError(source, name, text, "a number") from None


def seeds(args, study_seed):
    """Seeds from --seed, or --seeds of the study's streams."""
    if args.seeds is None:
        given = args.seed or [1]
        if min(given) < 0 or len(set(given)) < len(given):
            raise InputError("command line", "--seed", given, "distinct whole numbers from 0")
        return given
    if args.seed or args.seeds < 1:
        raise InputError("command line", "--seeds", args.seeds, "at least 1, without --seed")
    return settings.pour_seeds(study_seed, args.purpose, args.sample or 0, args.seeds)
