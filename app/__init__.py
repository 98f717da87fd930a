"""loopaudit: audits every control loop of a plant and says which verdicts can be trusted."""
