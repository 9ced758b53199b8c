"""Cohorts: a table of pairs, checked, planned, run by Snakemake or Slurm, and summed up. The standard library alone,
but for groups.py, which needs numpy. docs/manual/cohort.md"""
