"""Values of scattering models from Mitsuba 3.9.1, as a table for the tests: `python3 bsdf_values.py > bsdf_values.csv`.

Columns: model (an XML element without its tag), wi, wo, f·cos in red, green, blue for light that travels wo -> wi as
seen from a camera. One `<bsdf .../>` per `M` line, its pairs of directions on the `V` lines that follow.
"""

import math
import random

import mitsuba as mi

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
PAIRS = 6


def models():
    for distribution in ("ggx", "beckmann"):
        for alpha in (0.05, 0.3, 0.8):
            yield rough("roughconductor", distribution, alpha, '<string name="material" value="Au"/>')
            yield rough("roughdielectric", distribution, alpha, INDICES)
        yield anisotropic("roughconductor", distribution, '<rgb name="eta" value="0.2,0.9,1.1"/><rgb name="k" value="3.9,2.4,2.2"/>')
        yield anisotropic("roughdielectric", distribution, '<float name="int_ior" value="1.3"/>')
        for alpha in (0.05, 0.1, 0.3):
            yield rough("roughplastic", distribution, alpha, COLOURS)
            yield rough("roughplastic", distribution, alpha, COLOURS + '<boolean name="nonlinear" value="true"/>')
    for material in ("Ag", "Al", "Cr", "Cu", "TiO2", "W", "none"):
        yield rough("roughconductor", "ggx", 0.2, f'<string name="material" value="{material}"/>')
    yield bsdf("diffuse", '<rgb name="reflectance" value="0.1,0.5,0.8"/>')
    for nonlinear in ("true", "false"):
        for index in ("1.3", "1.9"):
            yield bsdf("plastic", COLOURS + f'<float name="int_ior" value="{index}"/><boolean name="nonlinear" value="{nonlinear}"/>')
    yield bsdf("plastic", "")
    yield bsdf("mask", '<float name="opacity" value="0.3"/>' + bsdf("diffuse", ""))
    yield bsdf("blendbsdf", '<float name="weight" value="0.3"/>' + bsdf("diffuse", "") + bsdf("plastic", COLOURS))
    yield bsdf("twosided", rough("roughplastic", "ggx", 0.2, COLOURS))
    yield from principled()


def principled():
    yield bsdf("principled", "")
    base = '<rgb name="base_color" value="0.8,0.4,0.1"/>'
    for more in (
        "roughness:0.2",
        "roughness:0.4 metallic:1",
        "roughness:0.4 metallic:0.5 anisotropic:0.7",
        "roughness:0.3 specular:0.9 spec_tint:0.6",
        "roughness:0.7 sheen:1 sheen_tint:0.4",
        "roughness:0.5 clearcoat:1 clearcoat_gloss:0.3",
        "roughness:0.5 flatness:0.8",
        "roughness:0.4 spec_trans:0.6 eta:1.5",
        "roughness:0.4 spec_trans:1 eta:1.3 anisotropic:0.5",
        "roughness:0.4 spec_trans:0.5 metallic:0.3 sheen:0.5 clearcoat:0.5 clearcoat_gloss:0.8 spec_tint:0.5 flatness:0.5",
    ):
        parameters = (item.split(":") for item in more.split())
        yield bsdf("principled", base + "".join(f'<float name="{name}" value="{value}"/>' for name, value in parameters))


INDICES = '<float name="int_ior" value="1.7"/><float name="ext_ior" value="1.1"/>'
COLOURS = '<rgb name="diffuse_reflectance" value="0.1,0.5,0.8"/><rgb name="specular_reflectance" value="1,0.9,0.5"/>'


def bsdf(kind, inside):
    return f'<bsdf type="{kind}">{inside}</bsdf>'


def rough(kind, distribution, alpha, inside):
    return bsdf(kind, f'<string name="distribution" value="{distribution}"/><float name="alpha" value="{alpha}"/>{inside}')


def anisotropic(kind, distribution, inside):
    alphas = '<float name="alpha_u" value="0.15"/><float name="alpha_v" value="0.45"/>'
    return bsdf(kind, f'<string name="distribution" value="{distribution}"/>{alphas}{inside}')


def directions(model, source):
    """More than half of the pairs along samples of the model, where its lobes are."""
    while True:
        wi = mi.warp.square_to_uniform_sphere(mi.Point2f(source.random(), source.random()))
        if abs(wi.z) < 0.1:
            continue
        one_sided = not any(kind in XML for kind in ("roughdielectric", "twosided", "spec_trans"))
        if one_sided and wi.z < 0:
            wi = mi.Vector3f(wi.x, wi.y, -wi.z)
        interaction = mi.SurfaceInteraction3f()
        interaction.wi, interaction.sh_frame, interaction.n = wi, mi.Frame3f(mi.Vector3f(0, 0, 1)), mi.Normal3f(0, 0, 1)
        if source.random() < 0.6:
            sample, _ = model.sample(mi.BSDFContext(), interaction, source.random(), mi.Point2f(source.random(), source.random()))
            wo = sample.wo
        else:
            wo = mi.warp.square_to_uniform_sphere(mi.Point2f(source.random(), source.random()))
        if abs(wo.z) < 0.05:
            continue
        length = math.sqrt(wo.x**2 + wo.y**2 + wo.z**2)
        value = model.eval(mi.BSDFContext(), interaction, wo / length)
        if max(value) > 1e-6 and all(math.isfinite(x) for x in value):
            yield wi, wo / length, value


XML = ""
for XML in models():
    model = mi.load_string(XML.replace("<bsdf", '<bsdf version="3.0.0"', 1))
    print("M", XML)
    pairs = directions(model, random.Random(XML))
    for _ in range(PAIRS):
        print("V", *(f"{x:.9g}" for vector in next(pairs) for x in vector))
