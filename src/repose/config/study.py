"""The study: one object that is made once from its files, checked, with every number in place."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.config import loader
from repose.config.making import Making
from repose.config.reading import read
from repose.core import provenance
from repose.core.parameter_space import ParameterSpace
from repose.core.targets import Targets

if TYPE_CHECKING:
    from repose.config.models import Settings
    from repose.particle.particle import Particle


@dataclass(frozen=True, eq=False)
class Study:
    """A study: its settings, and everything derived from them.

    Make it by `Study.load`, by `Study.of` from Python, or by `Study.of_results` in a job.

    Attributes
    ----------
    config : dict
        The resolved configuration as plain values, as `RESULTS/config.json` holds it.
    """

    config: dict[str, Any]
    _making: Making = field(repr=False)

    @classmethod
    def load(
        cls,
        *files: str | os.PathLike,
        overrides: Mapping[str, Any] | None = None,
        inputs: bool = False,
    ) -> "Study":
        """A study of configuration files, with each `auto` computed, and checked.

        Parameters
        ----------
        *files : path
            YAML or JSON files. Each may hold only the keys that differ; it overrides the files before it, and all
            override the defaults. A complete file needs no default. A file of `write_resolved` was checked before,
            and is read unchanged.
        overrides : mapping, optional
            Nested values over those of all files; their texts are read as YAML.
        inputs : bool, optional
            Check also the files that the configuration names, and that grain, bench test and time step fit together;
            this takes seconds. Otherwise these checks are made with the grain.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            With all faults at once: for each the file, the key, the value and what is allowed.
        """
        if not overrides and not inputs and loader.is_resolved(*files):
            return cls.of_results(files[0])
        study = cls.of(*loader.read_layers(files, overrides), inputs=inputs)
        provenance.note_config(study.config)
        return study

    @classmethod
    def of(cls, config: Mapping[str, Any], source: Any = "configuration", inputs: bool = False) -> "Study":
        """A study of a complete configuration.

        Parameters
        ----------
        config : mapping
            Every key; each may be `auto` that can be computed.
        source : str or Origin, optional
            File that an error names.
        inputs : bool, optional
            As in `load`.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            As in `load`.
        """
        making = Making(dict(config), source)
        making.complete(inputs)
        return cls(making.config, making)

    @classmethod
    def of_results(cls, path: str | os.PathLike) -> "Study":
        """The study of a folder of results, for a job.

        Parameters
        ----------
        path : path
            `RESULTS/config.json`, which was checked before. Nothing is checked again.

        Returns
        -------
        Study

        Raises
        ------
        InputError
            If the file cannot be read.
        """
        config = read(path)
        provenance.note_config(config)
        return cls(config, Making(config, str(path)))

    @cached_property
    def settings(self) -> "Settings":
        """The configuration as typed sections, such as `study.settings.funnel.seeds`."""
        from repose.config.models import settings_type

        return settings_type().model_validate(self.config)

    @cached_property
    def parameters(self) -> ParameterSpace:
        """Ranges of the free parameters, fixed values, prior knowledge."""
        return ParameterSpace.of(self.config["parameters"])

    @cached_property
    def targets(self) -> Targets:
        """The measured responses."""
        return Targets.of(self.config["targets"])

    @cached_property
    def folder(self) -> Path:
        """Folder of the results."""
        return Path(self.config["results_dir"])

    @property
    def grain(self) -> dict[str, Any]:
        """The mean berry, as in berry.json; with it the files that the configuration names are checked."""
        self.check_inputs()
        assert self._making.mean is not None
        return self._making.mean

    @property
    def particle(self) -> "Particle":
        """The body of the mean berry; with it the files that the configuration names are checked."""
        self.check_inputs()
        assert self._making.particle is not None
        return self._making.particle

    def check_inputs(self) -> None:
        """Check the files that the configuration names, and that grain, bench test and time step fit together.

        Raises
        ------
        InputError
            With all faults at once.
        """
        self._making.check_inputs()
