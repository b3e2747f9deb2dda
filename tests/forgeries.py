"""What may be altered in a certificate, so that it says what it does not prove."""

import base64
import zlib

import numpy as np


def stated_lower(document):
    bounds = document["bounds_m"]
    bounds[next(iter(bounds))] *= 0.99


def stated_lower_on_the_way(document):
    document["on_the_way"]["bound_m"] *= 0.99


def asked_less(document):
    *_, axis = document["setpoints"].values()
    axis["acceleration"]["bound"] *= 0.99


def limit_on_the_way_raised(document):
    document["on_the_way"]["limit_m"] *= 2.0


def stated_more(document):
    document["largest_met_m"] = dict.fromkeys(document["bounds_m"], 0.0)


def limits_of_axes_left_out(document):
    del document["setpoints"]


def limits_of_axes_denied(document):
    document["setpoints"] = None


def way_denied(document):
    document["on_the_way"] = None


def sooner(document):
    document["until_s"] -= 0.5


def longer(document):
    document["until_s"] += 1e-9


def bound_of_no_load(document):
    document["bounds_m"]["hook"] = 0.0


def bound_left_out(document):
    document["bounds_m"].clear()


def met_on_the_way(document):
    document["on_the_way"]["largest_met_m"] = 0.0


def a_part_of_the_box(document):
    document["parts"][0] = [[3, 5]]


def a_part_too_small_to_count(document):
    document["parts"][0] = [[1 << 40, 0]]


def limits_raised(document):
    limits = document["limits_m"]
    limits[next(iter(limits))] *= 2.0


def narrower(document):
    (ends,) = document["ranges"].values()
    ends[1] *= 0.99


def knots_moved(document):
    document["axes"]["knots"][3] += 1e-4


def later(document):
    document["from_s"] += 0.5


def scales_singular(document):
    document["scales"] = changed(document["scales"], "<f8", lambda scales: 0.0 * scales)


def motion_altered(document):
    document["motions"][0] = changed(document["motions"][0], "<i8", lambda c: c + c // 100)


def motion_cut(document):
    document["motions"][0]["shape"][0] += 1


def motion_missing(document):
    document["motions"].clear()


def sums_inexact(document):
    document["motions"][0] = changed(document["motions"][0], "<i8", lambda c: c * 2**20)


def quanta_odd(document):
    document["motions"][0]["quanta"][0] *= 3.0


def terms_fewer(document):
    document["terms"][0] -= 1


def quanta_uneven(document):
    document["motions"][0]["quanta"][0] *= 1.0 + 2.0**-50


def number_as_text(document):
    bounds = document["bounds_m"]
    bounds[next(iter(bounds))] = str(bounds[next(iter(bounds))])


def part_of_a_part(document):
    document["parts"][0] = [[0.5, 0.25]]


def terms_fractional(document):
    document["terms"][0] += 0.5


def shape_fractional(document):
    document["motions"][0]["shape"][0] += 0.5


def hidden_beside_an_array(document):
    document["scales"]["largest_met_m"] = 0.0


def hidden_behind_an_array(document):
    packed = document["motions"][0]
    packed["zlib"] = base64.b64encode(base64.b64decode(packed["zlib"]) + b"more").decode()


def hidden_among_axes(document):
    document["axes"]["jerk"] = []


def another_file(document):
    document["artefact_sha256"] = "0" * 64


def changed(packed, kind, change):
    values = np.frombuffer(zlib.decompress(base64.b64decode(packed["zlib"])), kind)
    content = base64.b64encode(zlib.compress(change(values).astype(kind).tobytes())).decode()
    return {**packed, "zlib": content}


FORGERIES = {  # and what the program says of each
    stated_lower: "does not prove what it says",
    stated_lower_on_the_way: "does not prove what it says",
    asked_less: "does not prove what it says of the setpoints",
    limit_on_the_way_raised: "does not cover all machines and limits",
    stated_more: "largest_met_m missing, or of no certificate",
    limits_of_axes_left_out: "setpoints missing, or of no certificate",
    limits_of_axes_denied: "does not prove what it says of the setpoints",
    way_denied: "does not cover all machines and limits",
    sooner: "about another time",
    longer: "about another time",
    bound_of_no_load: "is damaged",
    bound_left_out: "is damaged",
    met_on_the_way: "is damaged",
    a_part_of_the_box: "does not cover all machines",
    a_part_too_small_to_count: "is damaged",
    limits_raised: "does not cover all machines",
    narrower: "does not cover all machines",
    knots_moved: "does not belong to the file's setpoints",
    later: "about another time",
    scales_singular: "no bound of the tip follows from its boxes",
    motion_altered: "does not prove what it says",
    motion_cut: "is damaged",
    motion_missing: "is damaged",
    sums_inexact: "sums are not exact",
    terms_fewer: "is damaged",
    quanta_odd: "is damaged",
    quanta_uneven: "no powers of two",
    number_as_text: "is damaged",
    part_of_a_part: "is damaged",
    terms_fractional: "is damaged",
    shape_fractional: "is damaged",
    hidden_beside_an_array: "is damaged",
    hidden_behind_an_array: "is damaged",
    hidden_among_axes: "is damaged",
    another_file: "about another file",
}
