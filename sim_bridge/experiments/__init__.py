"""Monte-Carlo experiments in the lock-step world: arms, trials, statistics and figures from one YAML file.

:mod:`schema` says what an experiment is, :mod:`trial` runs one trial, :mod:`run` all of them on dask.distributed,
:mod:`store` keeps the results, :mod:`statistics` and :mod:`figures` say what they mean.
"""
