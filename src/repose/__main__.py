"""The verbs of the command line. The work is done in the modules; here they get their files and settings."""

import json
import os
import sys
import tempfile
from pathlib import Path

# Before numpy is loaded: the matrices are small, and sums split over threads end in other bits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from repose import arguments, settings
from repose.errors import InputError

# Frames of the film of a pour; each takes most of a second to draw.
FILM, SMALL_FILM = 72, 20


def main(words=None):
    """Run one verb. Returns the exit status: 0, 1 where a verification misses, or 2 where the input is at fault.

    A fault of the input is told in one line on stderr.
    """
    args = arguments.parser().parse_args(words)
    try:
        return VERBS[args.verb](args) or 0
    except (InputError, PermissionError, FileExistsError, NotADirectoryError) as error:
        print(f"repose: error: {error}", file=sys.stderr)
        return 2


def berry(args):
    """Eq. 1-4."""
    if args.axes or args.stl:
        _build(args)
        return
    from repose import berry

    section = settings.load(args.config)["berry"]
    material = (section["density_kg_m3"], section["poisson_ratio"], section["shear_modulus_pa"])
    berry.run(section["sizes"], section["compression"], args.table1, args.out, *material)


def _build(args):
    """Mesh of a berry from a few numbers."""
    from repose import crop

    if not (args.axes and args.stl and args.mass_g):
        raise InputError("command line", "berry --axes", args.axes, "together with --mass-g and --stl")
    density = args.density or settings.load(args.config)["berry"]["density_kg_m3"]
    details = (args.taper, args.wrinkles, args.wrinkle_depth_mm)
    mesh, number = crop.berry_mesh(args.axes, args.mass_g, density, *details, source="command line")
    Path(args.stl).parent.mkdir(parents=True, exist_ok=True)
    mesh.export(args.stl, file_type="stl")
    share = mesh.volume / (args.axes[0] * args.axes[1] * args.axes[2])
    m, k = crop.profile_exponents(number)
    print(
        f"{args.stl}: {mesh.volume:.1f} mm3, {share:.3f} of the box around it, profile (1 - |t|^{m:.3g})^{k:.3g}"
    )


def shape(args):
    """Mesh and particle."""
    config = settings.load(args.config)
    _particle(args.berry, config, args.out)


def _particle(berry_json, config, out_dir):
    """The configuration's particle, written to a folder."""
    from repose import shape

    section = config["berry"]
    return shape.run(
        berry_json,
        section["stl"],
        out_dir,
        kind=section["particle"],
        mass_g=section["mass_g"],
        spheres=section["spheres"],
        surface=section["surface"],
        time_step_s=config["heap"]["time_step_s"],
        restitution=config["parameters"]["e_gp"][0],
    )


def design(args):
    """Latin hypercube."""
    from repose import design

    config = settings.load(args.config)
    section = config["design"]
    design.run(config["parameters"], section["samples"], section["method"], section["seed"], args.out)


def pool_design(args):
    """Points of the pool."""
    from repose import pool

    config = settings.load(args.config)
    pool.run(config["parameters"], config["pool"], args.out)


def heap(args):
    """One heap job: pour and measure."""
    from repose.heap import run_job

    result = run_job(*_pour_arguments(args))
    if args.json:
        print(json.dumps(_flat(result) if len(result["runs"]) == 1 else result, indent=1))
    else:
        for run in result["runs"]:
            print(_run_line(run))


def pour(args):
    """One heap job, not yet measured."""
    from repose.heap import pour_job

    print(pour_job(*_pour_arguments(args)))


def _pour_arguments(args):
    """The arguments of `heap.pour_job` and `heap.run_job`."""
    config = settings.load(args.config)
    parameters = arguments.parameters(args, config["parameters"])
    seeds = arguments.seeds(args, config["design"]["seed"])
    step, end = config["heap"]["time_step_s"], config["heap"]["duration_s"]
    if args.trajectory is not None and not step <= args.trajectory <= end:
        raise InputError("command line", "--trajectory", args.trajectory, f"from {step:g} to {end:g} s")
    berry_of, particle = _berry_and_particle(args, config)

    from repose.dem.progress import display

    def progress(seed):
        return display(0.0, end, step, label=f"seed {seed}")

    name = f"{args.sample:03d}" if args.sample is not None else "heap"
    return config, name, parameters, seeds, particle, berry_of, args.out, args.trajectory, progress


def measure_heap(args):
    """Saved pours to measured piles."""
    config = settings.load(args.config)
    berry_of, particle = _berry_and_particle(args, config)

    from repose.measuring import measure_job

    for path in args.pours:
        result = measure_job(config, path, particle, berry_of, args.out)
        for run in result["runs"]:
            print(f"{path}: {_run_line(run)}")


def drum(args):
    """One drum job."""
    config = settings.load(args.config)
    parameters = arguments.parameters(args, config["parameters"])
    seeds = arguments.seeds(args, config["design"]["seed"])
    berry_of, particle = _berry_and_particle(args, config)

    from repose.drum import run_job

    results = run_job(config, parameters, seeds, particle, berry_of, args.out, args.trajectory)
    if args.json:
        print(json.dumps(results, indent=1))
    else:
        for result in results:
            print(_turn_line(result["run"]))


def drum_tables(args):
    """Drum jobs to tables."""
    from repose import drum_tables

    drum_tables.run(args.runs, args.out)


def shape_cell(args):
    """One cell of the shape study."""
    from repose import shape_study

    config = settings.load(args.config)
    shape_study.check(config, args.config)
    shape_study.run_cell(config, args.cell, args.berry, args.samples, args.out)


def shape_study(args):
    """Tables of the shape study."""
    from repose import shape_study

    shape_study.tables(settings.load(args.config), args.cells, args.out)


def measure(args):
    """Image measurement."""
    import cv2

    from repose import pile

    config = settings.load(args.config)
    how = pile.MeasureSettings.of(config["measure"], _axes(args, config))
    image = pile.read_image(args.picture)
    try:
        measured = pile.measure_image(image, args.mm_per_pixel, how)
    except pile.NoFlankError as error:
        allowed = "a pile with two flanks, seen from the side"
        raise InputError(args.picture, "pile", str(error), allowed) from None
    source = Path(args.picture)
    overlay = Path(args.overlay or source.with_name(f"{source.stem}_overlay.png"))
    overlay.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(overlay), pile.overlay(image, measured))
    values = measured.record()
    if args.json:
        print(json.dumps(values, indent=1))
        return
    print("left {left_deg:.2f} deg, right {right_deg:.2f} deg".format(**values))
    print("angle of repose {aor_deg:.2f} deg, Height {height_mm:.2f} mm".format(**values))
    for name in pile.DEFINITIONS:
        angle, mark = measured.angles.get(name), "  <- response" if name == how.response else ""
        print(f"{name:>10}: {f'{angle.aor_deg:.2f} deg{mark}' if angle else measured.reasons[name]}")
    print(f"fitted lines: {overlay}")


def measurement_study(args):
    """The definitions compared."""
    if args.shapes < 1:
        raise InputError("command line", "--shapes", args.shapes, "at least 1")
    config = settings.load(args.config)
    berry_of, particle = _berry_and_particle(args, config)

    from repose import measurement_study

    tables = measurement_study.run(
        args.heaps, args.representative, particle, config["measure"], berry_of, args.out, args.shapes
    )
    for table in tables.values():
        print(table.round(2).to_string(index="measured" not in table))


def _axes(args, config):
    """Mean axes of the berry, from the file given or from the sizes of the configuration."""
    if args.berry is not None:
        if not Path(args.berry).is_file():
            raise InputError(args.berry, "file", None, "an existing file, written by `repose berry`")
        return json.loads(Path(args.berry).read_text())
    if config["measure"]["berry_height_mm"] is not None:
        return {}
    from repose import berry

    sizes = berry.read_sizes(config["berry"]["sizes"])
    return {column: float(sizes[column].mean()) for column in berry.SIZE_COLUMNS}


def silhouette(args):
    """Side view of a simulated pile."""
    import cv2

    from repose.measuring import first_pour, side_view
    from repose.pile import MeasureSettings
    from repose.shape import Particle

    how = MeasureSettings(**settings.load(args.config)["measure"])
    picture = side_view(first_pour(args.heap), Particle.load(args.particle), how, args.azimuth)
    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(args.out, picture)


def dataset(args):
    """Heaps to tables."""
    from repose import dataset

    dataset.run(args.samples, args.heaps, args.out, args.prefix)


def network(args):
    """Surrogate."""
    from repose import training

    training.run(args.dataset, args.runs, settings.load(args.config)["network"], args.out)


def miga(args):
    """Inverse search."""
    from repose import miga
    from repose.extrapolation import Support

    config = settings.load(args.config)
    support = Support.of_dataset(args.dataset, config["parameters"]) if args.dataset else None
    summary = miga.run(
        args.network, config["parameters"], config["target"], config["miga"], args.table3, args.out, support
    )
    print(summary["message"])


def solutions(args):
    """What is to be simulated again."""
    from repose import validation

    config = settings.load(args.config)
    section = config["validation"]
    out = Path(args.out) / "solutions.csv"
    validation.write_solutions(
        args.feasible, section["published"], config["parameters"], section["solutions"], out
    )


def validate(args):
    """Table 4."""
    from repose import validation
    from repose.extrapolation import Support

    config = settings.load(args.config)
    published = config["validation"]["published"]
    support = Support.of_dataset(args.dataset, config["parameters"]) if args.dataset else None
    validation.run(args.solutions, args.heaps, published, config["target"], args.out, support)


def noise(args):
    """Noise floor."""
    from repose import noise

    print(noise.message(noise.run(args.runs, settings.load(args.config)["target"], args.out)))


def posterior(args):
    """Posterior of the six parameters."""
    from repose import posterior

    config = settings.load(args.config)
    files = {key: getattr(args, key) for key in arguments.POSTERIOR_FILES}
    summary = posterior.run(files, config["parameters"], config["target"], config["posterior"], args.out)
    print(posterior.message(summary))


def sensitivity(args):
    """Sobol indices and main effects."""
    from repose import sensitivity

    config = settings.load(args.config)
    table = sensitivity.run(args.network, config["parameters"], config["sensitivity"], args.out)
    print(sensitivity.message(table))


def compare_search(args):
    """Searches beside each other."""
    from repose.comparison import search

    config = settings.load(args.config)
    table = search.run(
        args.network,
        config["parameters"],
        config["target"],
        config["compare_search"],
        config["miga"],
        args.out,
    )
    print(search.message(table))


def compare_whole(args):
    """The method beside a response surface."""
    from repose.comparison import whole

    config = settings.load(args.config)
    section = config["compare_whole"]
    section |= {"network": config["network"] | {key: section[key] for key in ("starts", "epochs")}}
    section |= {"miga": config["miga"] | {"rounds": section["rounds"]}}
    table = whole.run(args.dataset, args.runs, config["parameters"], config["target"], section, args.out)
    print(whole.message(table))


def measure_responses(args):
    """More responses of saved pours."""
    from repose import responses

    config = settings.load(args.config)
    berry_of, particle = _berry_and_particle(args, config)
    table = responses.run(config, args.pours, args.runs, particle, berry_of, args.out)
    print(table[list(responses.MEASURED)].describe().round(2).to_string())


def drum_design(args):
    """A sample of the design in the drum."""
    from repose import drum

    config = settings.load(args.config)
    count = config["second_responses"]["drum_seeds"]
    seeds = settings.pour_seeds(config["design"]["seed"], "drum_design", args.sample, count)
    berry_of, particle = _berry_and_particle(args, config)
    parameters = arguments.parameters(args, config["parameters"])
    for run in drum.design_job(config, args.sample, parameters, seeds, particle, berry_of, args.out)["runs"]:
        print(_turn_line(run))


def second_responses(args):
    """What to measure next."""
    from repose import second_responses

    config = settings.load(args.config)
    section = config["second_responses"] | {"hidden": config["network"]["hidden"]}
    section |= {"epochs": config["network"]["epochs"]}
    section |= {"discrepancy_percent": config["posterior"]["discrepancy_percent"]}
    files = {"runs": args.runs, "dataset": args.dataset}
    if args.drum:
        files |= {"drum": args.drum, "drum_runs": args.drum_runs}
    summary = second_responses.run(files, config["parameters"], config["target"], section, args.out)
    print(second_responses.message(summary))


def refine_data(args):
    """Samples of the rounds added to those of the design."""
    from repose import refine

    refine.write_extended(args.dataset, args.runs, args.rounds, args.out)


def refine_search(args):
    """Inverse search near the last proposal."""
    from repose import refine

    config = settings.load(args.config)
    summary = refine.search(args.network, args.dataset, args.near, config, args.table3, args.out)
    print(summary["message"])


def refine_propose(args):
    """What a round simulates."""
    from repose import refine

    config = settings.load(args.config)
    seed, out = config["design"]["seed"], Path(args.out) / "proposal.csv"
    refine.write_proposal(
        args.feasible, args.network, config["parameters"], config["refine"], args.round, seed, out
    )


def refine_judge(args):
    """What a round has shown."""
    from repose import refine

    config = settings.load(args.config)
    files = (args.proposal, args.dataset, args.runs)
    verdict = refine.write_verdict(*files, config["target"], config["refine"], args.out)
    print(f"round {verdict['round']} {verdict['outcome']}", verdict["reason"], sep=": ")


def refine_tables(args):
    """All rounds in one table."""
    from repose import refine

    summary = refine.write_tables(args.verdicts, settings.load(args.config)["refine"]["rounds"], args.out)
    print(summary["why"])
    print(summary["claim"])


def compare_accuracy(args):
    """Accuracy of the network at fresh points."""
    from repose.comparison import accuracy

    table = accuracy.run(_comparison_files(args), settings.load(args.config)["network"], args.out)
    print(accuracy.message(table))


def compare_surrogates(args):
    """Surrogates at equal budgets."""
    from repose.comparison import surrogates

    config = settings.load(args.config)
    surrogates.run(_comparison_files(args), config["network"], config["pool"]["seed"], args.out)


def compare_sampling(args):
    """Designs, and points against seeds."""
    from repose.comparison import sampling

    config = settings.load(args.config)
    seeds, seed = config["heap"]["seeds"], config["pool"]["seed"]
    sampling.run(_comparison_files(args), config["parameters"], config["network"], seeds, seed, args.out)


def _comparison_files(args):
    """The files that a comparison on the pool reads, by name."""
    return {key: getattr(args, key) for key in arguments.COMPARISON_FILES}


def figure(args):
    """One figure."""
    from repose import figures

    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    figures.draw(args.name, arguments.pairs(args.input, "--input"), args.out, settings.load(args.config))


def film(args):
    """Animation."""
    from repose import film, stage
    from repose.shape import Particle

    config, particle = settings.load(args.config), Particle.load(args.particle)
    frames = SMALL_FILM if config["small_run"] else FILM
    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    if args.drum:
        film.animate_drum(args.trajectory, particle, args.out, config["drum"], frames=frames)
        return
    film.animate_pour(args.trajectory, particle, args.out, stage.funnel_walls(config["heap"]), frames=frames)


def table(args):
    """CSV to HTML."""
    from repose import tables

    tables.write_page(args.csv, args.title, args.out, settings.load(args.config)["small_run"])


def bench(args):
    """Speed."""
    from repose import bench, shape_study

    args.berry = args.particle = None
    config, particles = settings.load(args.config), {}
    for name, changes in config["shape_study"]["particles"].items():
        berry_of, particles[name] = _berry_and_particle(args, shape_study.changed(config, "berry", changes))
    result = bench.run(config, particles, berry_of)
    print(json.dumps(result, indent=1) if args.json else bench.message(result))


def check(args):
    """Configuration check."""
    if args.cores < 1:
        raise InputError("command line", "--cores", args.cores, "at least 1")
    config = settings.load(args.config)
    settings.check_inputs(config, args.config)
    work = settings.work(config)
    print(f"{args.config}: {config['label']}, good; results go to {config['results_dir']}")
    for purpose, sets, seeds in work["pours"]:
        print(f"{purpose:>14}: {sets} parameter sets x {seeds} seeds = {sets * seeds} pours")
    minutes = work["total_s"] / args.cores / 60
    print(f"about {work['pour_s']:.1f} s a pour, {minutes:.0f} min on {args.cores} cores")


def verify(args):
    """Verification suite."""
    for option in ("hits", "seeds"):
        if getattr(args, option) < 1:
            raise InputError("command line", f"--{option}", getattr(args, option), "at least 1")

    from repose import verification
    from repose.verification import report

    names = args.case or (list(verification.CASES) if args.all else None)
    pile = None
    if names and set(names) & set(verification.EXPENSIVE):
        args.berry = args.particle = None
        config = settings.load(args.config)
        berry_of, particle = _berry_and_particle(args, config)
        pile = (config, particle, berry_of)
    effort = verification.Effort(hits=args.hits, seeds=args.seeds, pile=pile)
    results = verification.run(
        names, effort, lambda name, result: print(_case_line(name, result), flush=True)
    )
    report.write(results, args.out)
    print(f"{args.out}/index.html")
    return 0 if all(result.passed for result in results.values()) else 1


def _case_line(name, result):
    """One case in words."""
    missed = [row for row in result.rows if not row.passed]
    words = (
        f"{len(missed)} of {len(result.rows)} numbers miss" if missed else f"{len(result.rows)} numbers, good"
    )
    return f"{name:>12}: {words}" + "".join(f"; {row.quantity} is {row.result:.6g}" for row in missed[:3])


def _berry_and_particle(args, config):
    """Moduli and particle from the files given, or made from the configuration."""
    from repose.shape import Particle

    with tempfile.TemporaryDirectory() as folder:
        section = config["berry"]
        berry_json = args.berry or Path(folder) / "berry.json"
        if args.berry is None:
            from repose import berry

            settings.check_inputs(config, args.config)
            material = (section["density_kg_m3"], section["poisson_ratio"], section["shear_modulus_pa"])
            berry.run(
                section["sizes"],
                section["compression"],
                arguments.PUBLISHED / "table1.csv",
                folder,
                *material,
            )
        if not Path(berry_json).is_file():
            raise InputError(berry_json, "file", None, "an existing file, written by `repose berry`")
        particle = (
            _particle(berry_json, config, folder) if args.particle is None else Particle.load(args.particle)
        )
        return json.loads(Path(berry_json).read_text()), particle


def _flat(result):
    """Result of a job with one seed as one record."""
    shared = {key: result[key] for key in ("parameters", "time_step_s")}
    return shared | result["runs"][0]


def _run_line(run):
    """One pour in words."""
    if run["status"] != "ok":
        return f"seed {run['seed']}: {run['status']}: {run['reason']}"
    return (
        f"seed {run['seed']}: angle of repose {run['aor_deg']:.2f} deg, Height {run['height_mm']:.1f} mm, "
        f"{run['berries_on_plate']} berries on the plate, {run['wall_s']:.1f} s"
    )


def _turn_line(run):
    """One run of the drum in words."""
    if run["status"] != "ok":
        return f"seed {run['seed']}: {run['status']}: {run['reason']}"
    return (
        f"seed {run['seed']}: first slip after {run['before_time_s']:.1f} s, {run['before_turned_deg']:.1f} deg; "
        f"surface {run['before_surface_deg']:.1f} deg before, {run['after_surface_deg']:.1f} deg after it, "
        f"{run['wall_s']:.0f} s"
    )


def snapshot(args):
    """Tables and pictures of a study."""
    from repose import snapshot

    for path in snapshot.take(args.results, args.out):
        print(path)


VERBS = {
    verb.__name__: verb
    for verb in (
        berry,
        shape,
        design,
        pool_design,
        heap,
        pour,
        measure_heap,
        drum,
        drum_tables,
        measure,
        silhouette,
        measurement_study,
        dataset,
        network,
        miga,
        solutions,
        validate,
        shape_cell,
        shape_study,
        noise,
        posterior,
        sensitivity,
        compare_search,
        compare_whole,
        measure_responses,
        drum_design,
        second_responses,
        refine_data,
        refine_search,
        refine_propose,
        refine_judge,
        refine_tables,
        compare_accuracy,
        compare_surrogates,
        compare_sampling,
        figure,
        film,
        table,
        bench,
        check,
        verify,
        snapshot,
    )
}

if __name__ == "__main__":
    sys.exit(main())
