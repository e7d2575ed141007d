"""Stages on the parts of a study, as the verbs call them."""

from repose.stages import answer, batches, miga, network, validate


def trained(dataset_csv, runs_csv, study, out, source="configuration"):
    return network.write_surrogate(
        dataset_csv,
        runs_csv,
        out,
        targets=study.targets,
        definitions=study.definitions,
        surrogate_kind=study.settings.surrogate,
        settings=study.settings.network,
        source=source,
    )


def searched(
    surrogate_json, study, table3_csv, out, support=None, source="configuration"
):
    return miga.find_solutions(
        surrogate_json,
        out,
        parameters=study.parameters,
        targets=study.targets,
        definitions=study.definitions,
        settings=study.settings.miga,
        table3_csv=table3_csv,
        support=support,
        source=source,
    )


def propose(name, study, folders, out):
    return batches.write_proposal(
        name, study, folders, out, definitions=study.definitions
    )


def conclude(name, study, folders, out):
    return batches.write_conclusion(
        name,
        folders,
        out,
        parameters=study.parameters,
        targets=study.targets,
        # a study in Python has no section `measure`
        measure=getattr(study.settings, "measure", None),
    )


def compared(solutions_csv, jobs, study, published, out, support=None):
    return validate.write_comparison(
        solutions_csv,
        jobs,
        out,
        targets=study.targets,
        measure=study.settings.measure,
        published=published,
        support=support,
    )


def answer_of(study, summary_json, check_csv, solutions_csv, card_dir=None):
    settings = study.settings
    return answer.read_answer(
        summary_json,
        check_csv,
        solutions_csv,
        label=settings.label,
        targets=study.targets,
        measure=settings.measure,
        strategy=settings.strategy,
        results_dir=settings.results_dir,
        card_dir=card_dir,
        small_run=settings.small_run,
    )
