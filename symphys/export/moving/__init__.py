"""How a model moves in MuJoCo: the time step and the gains that hold, and a trial."""
