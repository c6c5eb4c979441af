def planner_for(name, scenario, seed):
    from passpmp_ti.planner.baselines.names import baseline
    return baseline(name)
