"""The robot's cycle, without I/O: one exposure in; names, shots, a pose and a keyframe out.

`step` asks for what it needs of laser, reader and service on its way, as a shot does; whoever
carries it out may be a robot or a simulation of one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from robot_agent.activation.choice import PoseBelief
from robot_agent.activation.commands import Act
from robot_agent.activation.memory import Work
from robot_agent.activation.turn import Shooter, turn
from robot_agent.activation.verdict import Outcome
from robot_agent.atlas.atlas import Atlas, Chart
from robot_agent.atlas.onboard import OnBoard
from robot_agent.atlas.served import ServedMap
from robot_agent.backoff import Backoff
from robot_agent.cameras.camera import StereoPair
from robot_agent.jobs import Jobs
from robot_agent.keyframes import Moment, Spacing, is_due
from robot_agent.naming.belief import is_borne_out, is_contradicted
from robot_agent.naming.hunt import Hunt, Wishes
from robot_agent.naming.judge import Judge
from robot_agent.naming.named import Named
from robot_agent.naming.regular import expectation_of
from robot_agent.naming.sky import Sky
from robot_agent.naming.standing import Standing
from robot_agent.naming.tracker import Tracker
from robot_agent.naming.whereabouts import Whereabouts
from robot_agent.odometry.odometry import OdomPose
from robot_agent.odometry.wheels import Wheels
from robot_agent.odometry.wheels import step as odometry_step
from robot_agent.pan_tilt.looking import LookAround
from robot_agent.pan_tilt.mounting import CameraPose
from robot_agent.pan_tilt.unit import Angles
from robot_agent.perception.matching import View
from robot_agent.perception.spots import Optics, Spots, detect
from tagmap.conventions import Array
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.expectation import Expectation
from tagmap.localisation.constellation.expectation import Frame as Field
from tagmap.localisation.constellation.gate import gate
from tagmap.localisation.constellation.identify import Identity, identify
from tagmap.records import JobResult, Observation, Odometry, Pose, Sighting, Transform, WriteJob
from tagmap.records.arrays import transform, upper
from tagmap.records.keyframe import MAX_SIGHTINGS, IdentifiedBy

NEAREST_M, FURTHEST_M = 0.3, 30.0
FOLLOWED = 4
CONTRADICTED_NS = 300_000_000_000
"""Light alone does not name a tag for so long that answered at two places."""
MOST_WAIT_NS = 500_000_000
"""For leave to ask for a lease: the robot has more to do than to wait for that."""
STANDS = Odometry(
    T_prev_cur=Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
    cov=upper(1e-10 * np.eye(6)),
)


@dataclass(frozen=True, slots=True)
class Frame:
    """One exposure: where the camera was on the robot, where the robot was by its odometry (None:
    not known), whether its base stood, and whether its head did as well, so that it may shoot."""

    pair: StereoPair
    camera: CameraPose
    odom: OdomPose | None
    stands: bool
    is_still: bool


@dataclass(frozen=True, slots=True)
class News:
    """What the service has sent since the exposure before."""

    served: ServedMap | None = None
    jobs: Sequence[WriteJob] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """What to tell after a step. outcomes: of this exposure's shots. look: where to turn the head.
    names: of all spots that have one. chart: set when the map the robot goes by has changed."""

    observation: Observation | None
    pose: Pose
    results: tuple[JobResult, ...] = ()
    outcomes: tuple[Outcome, ...] = ()
    look: Angles | None = None
    names: tuple[Named, ...] = ()
    chart: Chart | None = None
    spots: int = 0


@dataclass(frozen=True, slots=True)
class Habits:
    """optics: what spots look like. confirm_s: a name that rests on position alone is lit again
    after so long, one that was followed since it was lit after FOLLOWED times that; 0: never.
    stationary: there is no odometer, for the robot never moves."""

    optics: Optics = field(default_factory=Optics)
    spacing: Spacing = field(default_factory=Spacing)
    wheels: Wheels = field(default_factory=Wheels)
    confirm_s: float = 30.0
    write_range_m: float = 30.0
    stationary: bool = False


class Agent:
    """One session. `shooter` None: there is no laser or no reader; `looking` None: no head."""

    def __init__(
        self,
        session: str,
        rig: StereoRig,
        atlas: Atlas,
        work: Work,
        habits: Habits,
        shooter: Shooter | None = None,
        looking: LookAround | None = None,
    ) -> None:
        self._rig, self._atlas, self._work, self._habits = rig, atlas, work, habits
        self._shooter, self._looking = shooter, looking
        self._field = Field.of(rig, NEAREST_M, FURTHEST_M)
        self._tracker, self._standing = Tracker(), Standing()
        self._onboard = OnBoard(rig, session, atlas.chart())
        self._whereabouts = Whereabouts()
        self._contradicted_ns: dict[str, int] = {}
        self._held: list[Sighting] = []
        self._is_borne_out = False
        self._expect: tuple[Catalogue, Expectation] | None = None
        self._jobs = Jobs(work.robot)
        self._lit_ns: dict[str, int] = {}
        self._began_ns: int | None = None
        self._has_more = False
        self._backoff = Backoff()
        self._before: Moment | None = None
        self._last: Moment | None = None

    @property
    def shooter(self) -> Shooter | None:
        return self._shooter

    def where(self) -> tuple[Array, Array] | None:
        """T_map_base and its covariance on the service's map, for whoever asks for a lease."""
        now = self._onboard.live()
        if self._onboard.chart.origin != "service" or now.T_map_base is None or now.cov is None:
            return None
        return now.T_map_base, now.cov

    def step(self, frame: Frame, news: News, now_ns: int) -> Act[Report]:
        """`now_ns` is the interlock's clock."""
        results = self._jobs.hear(news.jobs, now_ns)
        chart = self._hear(news.served)
        self._move(frame, now_ns)
        self._has_more = False
        self._held = []
        sky = self._see(frame)
        self._follow(sky)
        self._gate(sky)
        self._audit(sky)
        self._recognise(sky)
        outcomes: list[Outcome] = []
        shooter = self._shooter
        if frame.is_still and shooter is not None and self._may_ask(shooter, now_ns):
            outcomes = yield from self._shoot(shooter, sky, now_ns)
            results += [o.verdict.result for o in outcomes if o.verdict.result is not None]
        chart = self._remember(sky, outcomes) or chart
        observation = self._keyframe(sky, frame)
        return Report(
            observation,
            self._onboard.pose(frame.pair.t_ns),
            tuple(results),
            tuple(outcomes),
            self._look(sky, frame),
            tuple(sky.names.values()),
            chart,
            int(sky.left.usable.sum()),
        )

    def _hear(self, served: ServedMap | None) -> Chart | None:
        if served is None or not self._atlas.serve(served):
            return None
        return self._turn_to_new_chart()

    def _turn_to_new_chart(self) -> Chart:
        chart = self._atlas.chart()
        self._onboard.turn_to(chart)
        return chart

    def _move(self, frame: Frame, now_ns: int) -> None:
        """Everything that is known of places follows the odometry to this exposure."""
        before = self._before
        step = self._step_from(before, frame)
        self._tracker.move(step)
        self._onboard.move(step)
        if not frame.stands or step is None:
            self._standing.leave()
            if self._looking is not None and not frame.stands:
                self._looking.forget()
        self._standing.look(frame.camera.angles, now_ns)
        self._before = Moment(frame.pair.t_ns, frame.odom, frozenset(), frame.is_still)

    def _step_from(self, before: Moment | None, frame: Frame) -> Odometry | None:
        if before is None:
            return None
        if self._habits.stationary:
            return STANDS
        if before.odom is None or frame.odom is None:
            return None
        return odometry_step(before.odom, frame.odom, self._habits.wheels)

    def _see(self, frame: Frame) -> Sky:
        """Spots of both images, matched; without the pairs that light has refuted here."""
        left, right = (_view(detect(image, self._habits.optics)) for image in _images(frame.pair))
        false = self._standing.false_pairs(left.px, right.px)
        camera = frame.camera
        turns = not camera.rests
        return Sky(self._rig, left, right, camera.T_base_cam, camera.cov, turns, false)

    def _follow(self, sky: Sky) -> None:
        """Names of a moment ago."""
        for k, named in self._tracker.follow(*sky.places()).items():
            sky.name(k, named)

    def _gate(self, sky: Sky) -> None:
        """Names by the pose. A trace that the map contradicts is a name no more."""
        at = self._onboard.of_camera(sky.T_base_cam)
        self._is_borne_out = False
        if at is None or not len(sky):
            return
        catalogue = self._onboard.chart.catalogue
        found = gate(catalogue, sky.p_cam, sky.wide, *at, self._field)
        self._is_borne_out = is_borne_out(sky, catalogue.chart.p, at[0], found.tag)
        if self._is_borne_out:
            self._take(sky, found, "gate")

    def _judge(self, sky: Sky) -> Judge:
        table, live = self._onboard.chart.table, self._onboard.live()
        return Judge(sky, live, table, self._whereabouts, self._is_borne_out)

    def _audit(self, sky: Sky) -> None:
        """Names by light that were given before the robot knew where it was."""
        judge = self._judge(sky)
        if self._is_borne_out:
            judge.look_for(self._tracker.lost)
        for tag in judge.odd():
            self._tracker.drop(tag)
            sky.unname(tag)

    def _recognise(self, sky: Sky) -> None:
        """Names by the constellation, where the robot does not know where it is."""
        if self._onboard.of_camera(sky.T_base_cam) is not None or len(sky) < 3:
            return
        catalogue = self._onboard.chart.catalogue
        if self._expect is None or self._expect[0] is not catalogue:
            self._expect = catalogue, expectation_of(catalogue)
        found = identify(catalogue, sky.p_cam, sky.wide, self._field, expect=self._expect[1])
        if not is_contradicted(sky, found, catalogue, self._is_doubtful):
            self._take(sky, found, "constellation")

    def _take(self, sky: Sky, found: Identity, id_by: IdentifiedBy) -> None:
        chart = self._onboard.chart
        for k, row in enumerate(found.tag.tolist()):
            if row < 0 or self._is_doubtful(chart.catalogue.ids[row]):
                continue
            tag, p_false = chart.catalogue.ids[row], float(found.p_false[k])
            known = sky.names.get(sky.targets[k].pair)
            if known is None and not any(n.tag == tag for n in sky.names.values()):
                sky.name(k, Named(tag, id_by, p_false))
            elif known is not None and known.tag == tag:
                sky.name(k, replace(known, p_false=min(known.p_false, p_false)))
            elif known is not None and not known.is_lit:
                self._tracker.drop(known.tag)
                sky.unname(known.tag)

    def _is_doubtful(self, tag: str) -> bool:
        return self._whereabouts.is_doubtful(tag, self._onboard.chart.table)

    def _may_ask(self, shooter: Shooter, now_ns: int) -> bool:
        is_soon = shooter.holder.ask_at_ns - now_ns <= MOST_WAIT_NS
        return is_soon and not self._backoff.wait_s(1e-9 * now_ns)

    def _shoot(self, shooter: Shooter, sky: Sky, now_ns: int) -> Act[list[Outcome]]:
        hunt = self._hunt(shooter, sky, now_ns)
        work = replace(self._work, jobs=self._jobs.open)
        outcomes = yield from turn(shooter, hunt, work, now_ns)
        self._has_more = hunt(outcomes) is not None
        if outcomes and all(outcome.verdict.kind == "timeout" for outcome in outcomes):
            # A device is down: each try costs its patience.
            self._backoff.failed(1e-9 * outcomes[-1].ended_ns)
        elif outcomes:
            self._backoff.succeeded()
        named = {one.tag for one in sky.names.values() if one.id_by == "laser"}
        for outcome in outcomes:
            tag, result = outcome.verdict.tag, outcome.verdict.result
            if tag in named:
                self._lit_ns[tag] = outcome.ended_ns
            if result is not None:
                self._jobs.answer(result)
        held = [outcome.sighting() for outcome in hunt.held.values()]
        self._held = [sighting for sighting in held if sighting is not None]
        known_ns = self._contradicted_ns
        self._contradicted_ns = {tag: known_ns.get(tag, now_ns) for tag in hunt.contradicted}
        return outcomes

    def _hunt(self, shooter: Shooter, sky: Sky, now_ns: int) -> Hunt:
        known, judge = self._contradicted_ns.items(), self._judge(sky)
        return Hunt(
            sky,
            shooter.aimer,
            self._belief(sky),
            self._wishes(sky, now_ns),
            self._standing,
            judge,
            {tag for tag, since_ns in known if now_ns - since_ns <= CONTRADICTED_NS},
            told=judge.told(),
        )

    def _belief(self, sky: Sky) -> PoseBelief:
        at = self._onboard.of_camera(sky.T_base_cam)
        return PoseBelief.nothing() if at is None else PoseBelief(at[1])

    def _wishes(self, sky: Sky, now_ns: int) -> Wishes:
        """A name is doubtful that this robot has not lit for long, or not since it began; later
        where the tag was followed since."""
        began_ns = self._began_ns = now_ns if self._began_ns is None else self._began_ns
        followed = {named.tag for named in sky.names.values() if named.is_lit}
        confirm_ns = round(1e9 * self._habits.confirm_s)
        last_ns = {
            tag: lit_ns
            for tag in self._onboard.chart.table.index
            if (after_ns := confirm_ns * (FOLLOWED if tag in followed else 1))
            and (lit_ns := self._lit_ns.get(tag, began_ns)) <= now_ns - after_ns
        }
        doubtful = sorted(last_ns, key=lambda tag: last_ns[tag])
        return Wishes(self._jobs.open.keys(), doubtful, self._habits.write_range_m)

    def _remember(self, sky: Sky, outcomes: Sequence[Outcome]) -> Chart | None:
        """For the next exposure, and what was read in tags."""
        p_base, cov = sky.places()
        self._tracker.drop_seen_but({named.tag for named in sky.names.values()})
        for k, named in sky.named():
            if named.is_place:
                self._tracker.keep(named, p_base[k], cov[k])
        read = [
            self._atlas.read(o.verdict.tag, o.verdict.memory)
            for o in outcomes
            if o.verdict.tag is not None and o.verdict.memory is not None
        ]
        return self._turn_to_new_chart() if any(read) else None

    def _keyframe(self, sky: Sky, frame: Frame) -> Observation | None:
        sightings = sky.sightings()[:MAX_SIGHTINGS]
        tags = frozenset(sighting.tag for sighting in sightings)
        now = Moment(frame.pair.t_ns, frame.odom, tags, frame.is_still)
        last = self._last
        if not is_due(self._habits.spacing, last, now):
            return None
        self._last = now
        # What is not said of tags that hang elsewhere may be a pose that is wrong.
        self._onboard.see(frame.camera.T_base_cam, (*sightings, *self._held))
        return Observation(
            t_ns=frame.pair.t_ns,
            odom=self._step_from(last, frame),
            T_base_cam=transform(frame.camera.T_base_cam),
            sightings=sightings,
        )

    def _look(self, sky: Sky, frame: Frame) -> Angles | None:
        """Elsewhere, when there is nothing more to be had here and too little to be somewhere."""
        if self._looking is None or not frame.is_still or self._has_more:
            return None
        if frame.camera.angles is None:
            return None
        named = [k for k, _ in sky.named()]
        return self._looking.next(frame.camera.angles, sky.p_cam[named])


def _view(spots: Spots) -> View:
    return View(spots.px, spots.cov_px2, spots.usable)


def _images(pair: StereoPair) -> tuple[Array, Array]:
    return pair.left, pair.right
