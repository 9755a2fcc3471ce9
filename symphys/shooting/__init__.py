"""Problems as solvers see them: one function of z, or step by step."""

from symphys.shooting.shooting_problem import (
    Evaluator,
    Function,
    GuessedStates,
    LaterEvaluator,
    LaterNlp,
    Nlp,
    ScenarioEvaluator,
    ScenarioSamples,
    ShootingProblem,
    StepwiseEvaluator,
    Values,
    VariableBlock,
    WithoutResiduals,
)
from symphys.shooting.staged_problem import (
    AffinePolicy,
    CompiledRecursion,
    Expansion,
    Followed,
    Linearized,
    StagedMotion,
    StagedProblem,
)

__all__ = [
    "AffinePolicy",
    "CompiledRecursion",
    "Evaluator",
    "Expansion",
    "Followed",
    "Function",
    "GuessedStates",
    "LaterEvaluator",
    "LaterNlp",
    "Linearized",
    "Nlp",
    "ScenarioEvaluator",
    "ScenarioSamples",
    "ShootingProblem",
    "StagedMotion",
    "StagedProblem",
    "StepwiseEvaluator",
    "Values",
    "VariableBlock",
    "WithoutResiduals",
]
