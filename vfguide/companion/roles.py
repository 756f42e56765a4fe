"""The parts a vehicle can have in a formation: each turns a navigated state into a guidance step."""

from vfguide.companion.follower_role import FollowerRole
from vfguide.companion.leader_role import LeaderRole
from vfguide.companion.plan import FlightPlan
from vfguide.companion.role import Role
from vfguide.companion.shared_clock import SharedClock
from vfguide.companion.succession_role import SuccessionRole
from vfguide.laws.leader import LeaderTask


def role_of(plan: FlightPlan, clock: SharedClock) -> Role:
    """The part that a plan asks for, in a formation that shares this clock."""
    if plan.lead is not None:
        return SuccessionRole(plan, plan.lead, clock)
    task = plan.task
    if isinstance(task, LeaderTask):
        return LeaderRole(plan, task, clock)
    return FollowerRole(plan, task, clock)
