"""The parts a vehicle can have in a formation: each turns a navigated state into a guidance step."""

from vfguide.companion.arrangements import Arrangements
from vfguide.companion.follower_role import FollowerRole
from vfguide.companion.leader_role import LeaderRole
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import Role
from vfguide.companion.shared_clock import SharedClock
from vfguide.companion.succession_role import SuccessionRole
from vfguide.laws.leader import LeaderTask


def role_of(plan: FlightPlan, clock: SharedClock, arrangements: Arrangements | None = None) -> Role:
    """The part that a plan asks for, in a formation that shares this clock and these arrangements."""
    task = plan.task
    arrangements = arrangements or Arrangements(plan, clock)
    if plan.lead is not None:
        return SuccessionRole(plan, plan.lead, clock, arrangements)
    if isinstance(task, LeaderTask):
        return LeaderRole(plan, task, clock, arrangements)
    return FollowerRole(plan, task, clock, arrangements)
