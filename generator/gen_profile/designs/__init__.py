"""The main job: a motion planned, exported, checked and delivered, or what to change; FMUs written."""
