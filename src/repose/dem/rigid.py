"""Time integration of rigid bodies, and the rolling resistance torque.

Leapfrog for the translation; the rotation keeps the angular momentum in the world frame as its state (so that free
rotation conserves it exactly) and turns the quaternion with the angular velocity of the half step.
"""

import math

from . import state as st
from .geometry import to_body, to_world
from .jit import inlined, kernel
from .neighbours import mark_moved


@inlined
def angular_velocity(qw, qx, qy, qz, mobility, lx, ly, lz):
    """Angular velocity (world) of a body with angular momentum l (world); mobility: 1 / principal moments."""
    b1, b2, b3 = to_body(qw, qx, qy, qz, lx, ly, lz)
    return to_world(qw, qx, qy, qz, b1 * mobility[0], b2 * mobility[1], b3 * mobility[2])


@inlined
def turned(qw, qx, qy, qz, ox, oy, oz, half):
    """Quaternion after turning with angular velocity o (world) for twice `half` seconds, normalised."""
    a = qw - half * (ox * qx + oy * qy + oz * qz)
    b = qx + half * (ox * qw + oy * qz - oz * qy)
    c = qy + half * (oy * qw + oz * qx - ox * qz)
    d = qz + half * (oz * qw + ox * qy - oy * qx)
    inv = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    return a * inv, b * inv, c * inv, d * inv


@kernel
def integrate(bodies, grid, counts, physics, radius, time):
    """Advance every body by one time step under its load.

    Rolling resistance acts as a budget: the sum of mu_r F_n R over a body's contacts opposes the rotation that all
    other torques leave; it can stop it but never reverse it, so a settled pile is at rest.
    """
    rows = bodies.rows
    dt = physics.dt
    kick = dt / physics.mass
    mobility = physics.mobility
    sure_stop = min(mobility[0], mobility[1], mobility[2]) / max(mobility[0], mobility[1], mobility[2])
    limit2 = (0.5 * grid.lengths[2]) ** 2
    for i in range(counts[st.N_BODIES]):
        if bodies.presence[i] != st.PRESENT:
            continue
        vx = rows[i, 7] + kick * bodies.load[i, 0] + dt * physics.gravity[0]
        vy = rows[i, 8] + kick * bodies.load[i, 1] + dt * physics.gravity[1]
        vz = rows[i, 9] + kick * bodies.load[i, 2] + dt * physics.gravity[2]
        rows[i, 7] = vx
        rows[i, 8] = vy
        rows[i, 9] = vz
        before = rows[i, 2]
        rows[i, 0] += dt * vx
        rows[i, 1] += dt * vy
        rows[i, 2] += dt * vz
        if before >= physics.exit_height and rows[i, 2] < physics.exit_height:
            bodies.exit_time[i] = time
        path = math.sqrt(vx * vx + vy * vy + vz * vz)

        lx = bodies.momentum[i, 0] + dt * bodies.load[i, 3]
        ly = bodies.momentum[i, 1] + dt * bodies.load[i, 4]
        lz = bodies.momentum[i, 2] + dt * bodies.load[i, 5]
        qw, qx, qy, qz = rows[i, 3], rows[i, 4], rows[i, 5], rows[i, 6]
        budget = dt * bodies.load[i, st.ROLL]
        ox = oy = oz = speed = 0.0
        # the budget stops the rotation for sure when it outweighs the largest |omega| that |l| allows
        if (sure_stop * budget) ** 2 >= lx * lx + ly * ly + lz * lz:
            lx = ly = lz = 0.0
        else:
            ox, oy, oz = angular_velocity(qw, qx, qy, qz, mobility, lx, ly, lz)
            speed = math.sqrt(ox * ox + oy * oy + oz * oz)
            inv = 1.0 / speed
            ex, ey, ez = ox * inv, oy * inv, oz * inv
            rx, ry, rz = angular_velocity(qw, qx, qy, qz, mobility, budget * ex, budget * ey, budget * ez)
            if ex * rx + ey * ry + ez * rz >= speed:
                lx = ly = lz = 0.0
                ox = oy = oz = speed = 0.0
            else:
                lx -= budget * ex
                ly -= budget * ey
                lz -= budget * ez
                ox -= rx
                oy -= ry
                oz -= rz
        bodies.momentum[i, 0] = lx
        bodies.momentum[i, 1] = ly
        bodies.momentum[i, 2] = lz
        if speed > 0.0:
            hw, hx, hy, hz = turned(qw, qx, qy, qz, ox, oy, oz, 0.25 * dt)
            ox, oy, oz = angular_velocity(hw, hx, hy, hz, mobility, lx, ly, lz)
            qw, qx, qy, qz = turned(qw, qx, qy, qz, ox, oy, oz, 0.5 * dt)
            rows[i, 3] = qw
            rows[i, 4] = qx
            rows[i, 5] = qy
            rows[i, 6] = qz
            path += radius * math.sqrt(ox * ox + oy * oy + oz * oz)
        rows[i, 10] = ox
        rows[i, 11] = oy
        rows[i, 12] = oz
        bodies.odometer[i] += dt * path
        mx = rows[i, 0] - grid.reference[i, 0]
        my = rows[i, 1] - grid.reference[i, 1]
        mz = rows[i, 2] - grid.reference[i, 2]
        if mx * mx + my * my + mz * mz > limit2:
            mark_moved(grid, counts, i)
        if rows[i, 2] < physics.floor_height:
            bodies.presence[i] = st.GONE
            mark_moved(grid, counts, i)
