import repose.bench  # noqa: F401  (makes the responses known by name)
import research  # noqa: F401  (one thread for small matrices, before numpy is loaded)
