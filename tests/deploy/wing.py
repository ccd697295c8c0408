"""The paths that only a daemon with --hospital has, by the public description of the API."""
import os
import re

import yaml

OPENAPI = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "proto", "openapi.yaml")


def paths():
    """Each path, with a value in place of each parameter, and whether it is one of those. tests/unit/http/openapi_test.cpp
    holds their tag against the routes of the daemon."""
    with open(OPENAPI, encoding="utf-8") as text:
        described = yaml.safe_load(text)["paths"]
    return {re.sub(r"\{\w+\}", "1", path): any("orders" in operation["tags"] for operation in item.values()
                                               if isinstance(operation, dict)) for path, item in described.items()}


def roots():
    """The same paths without what follows a parameter and what other paths begin with."""
    wing = [path for path, is_wing in paths().items() if is_wing]
    return [path for path in wing if not any(path.startswith(other + "/") for other in wing)]
