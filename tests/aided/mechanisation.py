import numpy as np

from imubench_pipeline.extensions.aided.strapdown import propagate_sample


def mechanise(
    p: np.ndarray,
    v: np.ndarray,
    C: np.ndarray,
    rate: np.ndarray,
    force: np.ndarray,
    T: float,
    earth: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and attitude from samples; the first is the start."""
    p, v, C, room = p.copy(), v.copy(), C.copy(), np.empty((4, 3, 3))
    reached = [(p.copy(), v.copy(), C.copy())]
    for w, f in zip(rate, force, strict=True):
        propagate_sample(p, v, C, w, f, T, earth, room)
        reached.append((p.copy(), v.copy(), C.copy()))
    positions, velocities, attitudes = (np.array(each) for each in zip(*reached, strict=True))
    return positions, velocities, attitudes
