"""``GET /api/progress``, two counts, and ``GET /api/stats``: progress, pace and agreement."""

from __future__ import annotations

from dataclasses import asdict

from fastapi import APIRouter

from cadpose.annotations.database.standing import SETTLING
from cadpose.annotations.store import Selection
from cadpose.review.answers import (
    Agreement,
    AuthorTold,
    BetweenPeople,
    DayTold,
    ProgressAnswer,
    StatsAnswer,
    WithMachine,
)
from cadpose.review.desk import Desk


def statistics_routes(desk: Desk) -> APIRouter:
    """Both routes."""
    routes = APIRouter()

    @routes.get("/progress")
    def progress() -> ProgressAnswer:
        return ProgressAnswer(
            total=desk.store.count(),
            decided=desk.store.count(Selection(decided_by="human", verdicts=SETTLING)),
        )

    @routes.get("/stats")
    def stats() -> StatsAnswer:
        told = desk.store.reviewing()
        return StatsAnswer(
            total=told.total,
            decided=told.decided,
            by_verdict=told.by_verdict,
            authors=[AuthorTold(**asdict(pace)) for pace in told.authors],
            days=[DayTold(day=day, decisions=count) for day, count in told.days],
            agreement=Agreement(
                between_people=BetweenPeople(**asdict(told.between_people)),
                with_machine=WithMachine(**asdict(told.with_machine)),
            ),
        )

    return routes
