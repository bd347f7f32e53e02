"""Studies: measure steppers with solvers on whole simulations of a scene, with the error at the end."""
