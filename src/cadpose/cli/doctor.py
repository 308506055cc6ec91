"""``cadpose doctor``."""

from __future__ import annotations

import dataclasses

import typer

from cadpose.cli.options import Json
from cadpose.cli.output import print_json, print_table


def doctor(json: Json = False) -> None:
    """Tell what is installed, what is missing and how to get it."""
    from cadpose.doctor import healthy, report

    checks = report()
    if json:
        print_json([dataclasses.asdict(check) for check in checks])
    else:
        rows = [[check.name, check.status, check.detail, check.mend] for check in checks]
        print_table("cadpose doctor", ["what", "status", "found", "how to mend"], rows)
    if not healthy(checks):
        raise typer.Exit(1)
