"""What scripts/results and scripts/compare share: reading, scoring, measuring and the peers. Needs numpy, scipy, nibabel."""
