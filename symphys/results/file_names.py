"""The files of a run folder.

| file | holds |
|---|---|
| problem.toml | the problem file as it was read, includes resolved |
| config.json | what was asked for: ``symphys.results.config`` |
| result.json | what was found: ``symphys.results.result`` |
| trace.csv | a row for each iteration: ``symphys.results.trace`` |
| trajectory.npz, guess.npz | the motion of the result and of the guess: ``symphys.trajectory`` |
| film.npz | coarse motions along the solve: ``symphys.results.film`` |
| scene.json | bodies, static surfaces and joints to draw: ``symphys.results.scene`` |
| gains.npz | of solvers that find feedback: its gains |
| multipliers.npz | those of constraints and bounds at the solution, where the solver has them |
| checkpoint.json | where an interrupted solve goes on |
| log.txt | what the solver printed |
| report.html, figures/ | the page, made from the others |
"""

PROBLEM, CONFIG, RESULT, CHECKPOINT = "problem.toml", "config.json", "result.json", "checkpoint.json"
TRAJECTORY, GUESS, SCENE, TRACE, LOG = "trajectory.npz", "guess.npz", "scene.json", "trace.csv", "log.txt"
GAINS, MULTIPLIERS, FILM, FIGURES = "gains.npz", "multipliers.npz", "film.npz", "figures"
