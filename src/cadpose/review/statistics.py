"""``GET /api/progress``, two counts, and ``GET /api/stats``: progress, pace and agreement."""

from __future__ import annotations

from fastapi import APIRouter

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

#: Verdicts of a person after which an annotation counts as decided; "later" is none.
FINAL = ("accept", "edit", "reject")


def statistics_routes(desk: Desk) -> APIRouter:
    """Both routes."""
    routes = APIRouter()

    @routes.get("/progress")
    def progress() -> ProgressAnswer:
        return ProgressAnswer(
            total=desk.store.count(),
            decided=desk.store.count(Selection(decided_by="human", verdicts=FINAL)),
        )

    @routes.get("/stats")
    def stats() -> StatsAnswer:
        told = desk.store.reviewing()
        people, machine = told.between_people, told.with_machine
        return StatsAnswer(
            total=told.total,
            decided=told.decided,
            by_verdict=told.by_verdict,
            authors=[
                AuthorTold(
                    author=pace.author,
                    decisions=pace.decisions,
                    last_hour=pace.last_hour,
                    median_seconds=pace.median_seconds,
                )
                for pace in told.authors
            ],
            days=[DayTold(day=day, decisions=count) for day, count in told.days],
            agreement=Agreement(
                between_people=BetweenPeople(
                    pairs=people.pairs,
                    same_verdict=people.same_verdict,
                    median_rotation_deg=people.median_rotation_deg,
                ),
                with_machine=WithMachine(
                    decided=machine.decided,
                    accepted_unchanged=machine.accepted_unchanged,
                    edited=machine.edited,
                    rejected=machine.rejected,
                ),
            ),
        )

    return routes
