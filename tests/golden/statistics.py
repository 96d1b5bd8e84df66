"""Writes statistics.json: the statistics of comparisons, from numpy, scipy, and bootstraps that are counted out in full.

The interquartile mean is scipy's 25 % trimmed mean where a quarter of the sample is a whole number of values; elsewhere
each value is repeated four times first, which changes no weighted mean and makes it one. The probability of
improvement is the Mann-Whitney U over the number of pairs. A bootstrap of a small sample has finitely many resamples:
all are listed, and the quantiles stand at the ranks that a drawn bootstrap of 2000 resamples must hit within three
standard errors. The nested bootstrap is of the mean of the runs' means. Needs numpy and scipy.
"""

import itertools
import json
import pathlib

import numpy
import scipy.stats

SEED = 20240915
# 2.5 % and 97.5 % with three standard errors of 2000 draws: sqrt(0.025 * 0.975 / 2000) = 0.35 %.
BRACKETS = [0.0145, 0.0355, 0.9645, 0.9855]


def interquartile_mean(values):
    return float(scipy.stats.trim_mean(numpy.repeat(values, 4), 0.25))


def brackets(statistics):
    return [float(value) for value in numpy.quantile(statistics, BRACKETS, method="inverted_cdf")]


def all_resamples(values):
    return itertools.product(values, repeat=len(values))


def main():
    rng = numpy.random.default_rng(SEED)
    samples = [rng.normal(1.0, 0.5, n) for n in (1, 2, 3, 4, 5, 7, 8, 20)]
    summaries = [
        {
            "values": list(values),
            "interquartile_mean": interquartile_mean(values),
            "population_std": float(numpy.std(values)),
            "quantiles": [float(q) for q in numpy.quantile(values, [0.0, 0.1, 0.5, 0.83, 1.0])],
        }
        for values in samples
    ]
    # Rounded, so that some pairs are equal.
    pairs = [(rng.normal(1.0, 0.5, n).round(1), rng.normal(1.2, 0.5, m).round(1)) for n, m in ((5, 5), (5, 1), (12, 9))]
    improvements = [
        {
            "x": list(x),
            "y": list(y),
            "probability": float(scipy.stats.mannwhitneyu(x, y).statistic / (len(x) * len(y))),
        }
        for x, y in pairs
    ]
    five, other = rng.normal(2.0, 0.3, 5), rng.normal(0.5, 0.1, 4)
    means = [interquartile_mean(resample) for resample in all_resamples(five)]
    others = numpy.array([interquartile_mean(resample) for resample in all_resamples(other)])
    ratios = (numpy.array(means)[:, None] / others[None, :]).ravel()
    bootstraps = [
        {"groups": [list(five)], "brackets": brackets(means)},
        {"groups": [list(five), list(other)], "brackets": brackets(ratios)},
    ]
    runs = rng.normal(1.0, 0.3, (3, 1)) + rng.normal(0.0, 0.2, (3, 3))
    nested = []
    for drawn in all_resamples(range(len(runs))):
        means_of_runs = [[numpy.mean(resample) for resample in all_resamples(runs[run])] for run in drawn]
        nested.extend(numpy.mean(combination) for combination in itertools.product(*means_of_runs))
    golden = {
        "summaries": summaries,
        "improvements": improvements,
        "bootstraps": bootstraps,
        "nested": {"runs": runs.tolist(), "brackets": brackets(nested)},
    }
    path = pathlib.Path(__file__).with_suffix(".json")
    path.write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
