"""The chain that runs in many environments is run by hand; its command lines must be those of today's verbs."""

import chain

from repose import cli


def test_every_verb_of_the_chain_knows_its_options(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = tmp_path / "results/validation/solutions.csv"
    table.parent.mkdir(parents=True)
    table.write_text("sample\n1\n")
    parser = cli.make_parser()
    lines = list(chain.verbs(1))
    assert len(lines) > 10
    for line in lines:
        parser.parse_args(
            [*chain.arguments_of(line), "--config", "results/config.json"]
        )
