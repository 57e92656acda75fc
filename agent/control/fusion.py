"""Hybrid control: blend trajectory tracking with the reactive controller by how near the next thing is.

The paper's equations:

    w_agent = max(1 - r_agent/r_th, 0)      w_obs = max(1 - r_obs/r_th, 0)      w = max(w_agent, w_obs)
    a_hyb = (1 - w) a_req + w a_APF
"""

from protocols.kernels import kernel


@kernel
def risk_weight(r_agent: float, r_obs: float, r_th: float) -> float:
    """How much the reactive controller counts, in [0, 1].

    ``r_agent``: distance to the nearest agent, ``r_obs``: to the nearest obstacle surface (inf where there
    is none), ``r_th``: distance at which the risk begins; all in metres.
    """
    return max(1.0 - max(min(r_agent, r_obs), 0.0) / r_th, 0.0)


@kernel
def apf_blend(
    req_x: float, req_y: float, apf_x: float, apf_y: float, r_agent: float, r_obs: float, r_th: float
) -> tuple[float, float]:
    """a_hyb [m/s²] from the tracking acceleration ``req`` and the reactive one ``apf``; not yet limited."""
    w = risk_weight(r_agent, r_obs, r_th)
    return (1.0 - w) * req_x + w * apf_x, (1.0 - w) * req_y + w * apf_y
