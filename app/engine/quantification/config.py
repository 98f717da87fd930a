"""What the quantification tries, and the few numbers that were fitted so that its intervals hold."""

from dataclasses import dataclass


@dataclass(frozen=True)
class QuantificationConfig:
    """Shares of S are of R, the range that OP covers in a lively cycle (the 80th percentile over cycles).

    S_shares: lowest, highest and number of the values of S, spaced at equal ratios. he_jumps, kano_jumps: J / S of the
    two valve forms. lags_pv, lags_v: regressors of the one-step prediction. samples_per_cycle: finer records are
    thinned to about this. most_cycles, most_samples: how many of the newest are used.

    evidence_weight, discrepancy, unseen, failure_share, usual_share, usual_spread: fitted on simulated loops
    (docs/QUANTIFICATION.md). A sample counts for `evidence_weight` of an independent one, because no model is true.
    `discrepancy`, in the logarithm of S, is the error of the best model when noise no longer matters. S is read low by
    `unseen` times the noise, because the valve follows OP at every scan of the controller and the record shows one scan
    a sample; noise is the share of PV's standard deviation that the best valve leaves unpredicted, at most
    `most_noise`. In `failure_share` of loops the model fails, and the share is drawn around 0.6 with a factor of 2.2.
    Before a look at the record, S is `usual_share` of R within a factor e^usual_spread.
    he_chance: chance of He's form before a look at the record; the rest is Kano's.

    min_regularity, min_cycles, min_samples_per_cycle, min_evidence, most_width: the rule of what is identifiable. It
    needs a regular limit cycle, long enough and sampled finely enough, a gain in log-likelihood of stiction over a
    linear valve, and an upper bound on the logarithm of the ratio of the ends of the 80 % interval.
    """

    S_shares: tuple[float, float, int] = (0.08, 1.3, 32)
    he_jumps: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    kano_jumps: tuple[float, ...] = (0.15, 0.3, 0.5, 0.7, 0.85, 1.0)
    lags_pv: int = 10
    lags_v: int = 15
    samples_per_cycle: int = 40
    most_cycles: int = 25
    most_samples: int = 1200
    evidence_weight: float = 0.11
    discrepancy: float = 0.085
    unseen: float = 0.3
    most_noise: float = 0.5
    failure_share: float = 0.05
    usual_share: float = 0.75
    usual_spread: float = 0.6
    he_chance: float = 0.6
    min_regularity: float = 1.0
    min_cycles: float = 5.0
    min_samples_per_cycle: float = 8.0
    min_evidence: float = 20.0
    most_width: float = 0.7
