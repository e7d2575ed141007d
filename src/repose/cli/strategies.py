"""Subcommands of strategies with several batches: the next batch, and the answer."""

import argparse

from repose.cli.registry import Option, subcommand
from repose.common.numbers import format_decimals
from repose.config.pipeline import PipelineConfig

DEFAULT_FOLDER = "results/sequential"
STRATEGY = Option("strategy", help="name of the strategy", recorded=False)


@subcommand(
    STRATEGY,
    Option(
        "batches",
        nargs="*",
        help="folders of all batches so far: dataset.csv and runs.csv",
    ),
    out=f"{DEFAULT_FOLDER}/batch_0",
)
def propose(args: argparse.Namespace, study: PipelineConfig) -> None:
    """List the samples that a strategy simulates next, and explain why.

    They follow from the batches so far, or check the answer of the strategy.

    Examples
    --------
    $ repose stage propose sequential results/sequential/batch_0 --out results/sequential/batch_1
    """
    from repose.stages import batches

    proposal = batches.write_proposal(
        args.strategy,
        study.study(),
        folders=args.batches,
        out_dir=args.out,
        definitions=study.definitions,
        parameter_names=study.parameter_names,
        source=args.config,
    )
    print(proposal["why"])


@subcommand(
    STRATEGY,
    Option(
        "batches",
        nargs="+",
        help="folders of all batches; the last one is that of the answer",
    ),
    out=DEFAULT_FOLDER,
)
def conclude(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Compare a strategy's simulated answer with its prediction and the targets.

    All batches are collected in one table.

    Examples
    --------
    $ repose stage conclude sequential results/sequential/batch_0 results/sequential/batch_1
    """
    from repose.stages import batches

    check = batches.write_conclusion(
        args.strategy,
        args.batches,
        args.out,
        parameters=study.parameters,
        targets=study.targets,
        measure=study.settings.measure,
        parameter_names=study.parameter_names,
    )
    for row in check.to_dict("records"):
        print(
            f"{row['response']}: {format_decimals(row['simulated'])}, "
            f"{row['deviation_percent']:+.2f} % off the target"
        )
