"""Compares the results of the uniform and the layered model for the same stand.

Run: python examples/compare_models.py
"""

from aosplan import PlanRequest, plan

if __name__ == "__main__":
    print("model    optimize   N     b [m]   side [m]   V̂")
    for model in ("uniform", "layered"):
        for objective in ("samples", "aperture", "time"):
            result = plan(PlanRequest(altitude=50, vhat="98%", model=model, optimize=objective))
            solution = result.solution
            print(
                f"{model:8} {objective:9} {solution.pattern.samples:4d}  {solution.baseline_m:7.3f}"
                f"  {max(result.extent_m):8.2f}   {solution.prediction.normalized:.4f}"
            )
