//! Rules of bands, body, sensor and lights.

use super::*;

const COEFFICIENTS: &str = "{ sigma_t_per_mm = 10, albedo = [0.9, 0.8, 0.7], g = 0 }";
const SENSOR: &str = "sensor.probe = { point_mm = [0, 0, 3], toward = [0, 0, -1] }";
const LIGHT: &str = "directional = { toward = [1, 1, 1], irradiance = 1.0 }";

/// The good experiment in three spectral bands.
fn spectral(old: &str, new: &str) -> String {
    GOOD.replace("rgb = {}", "spectral = { from_nm = 400, to_nm = 700, count = 3 }").replace(old, new)
}

#[test]
fn bands_run_upwards_and_have_unique_names() {
    let message = refused("rgb = {}", "spectral = { from_nm = 700, to_nm = 400, count = 3 }");
    holds(&message, "`from_nm` must be less than `to_nm`, is 700 and 400", "3:34", "");
    let message =
        refused("rgb = {}", "explicit = [{ name = \"a\" }, { name = \"b\" }, { name = \"a\" }]");
    holds(&message, "two bands are named `a`", "3:64", "");
    let bands = "explicit = [{ name = \"a\", from_nm = 400 }, { name = \"b\" }, { name = \"c\" }]";
    holds(&refused("rgb = {}", bands), "`from_nm` needs `to_nm` beside it", "3:47", "");
    let message = refused("rgb = {}", "spectral = { from_nm = 400, to_nm = 700, count = 2000 }");
    assert!(message.contains("must be at most 1024, is 2000"), "{message}");
    let message = refused("rgb = {}", "spectral = { from_nm = 400, to_nm = 700, count = 99999999999 }");
    assert!(message.contains("must be at most 1024, is 99999999999"), "{message}");
    let narrow = GOOD.replace("rgb = {}", "spectral = { from_nm = 400, to_nm = 400.5, count = 100 }");
    let message = errors(&narrow.replace("[0.9, 0.8, 0.7]", "0.9"));
    holds(&message, "bins must be at least 0.01 nm wide", "3:62", "");
    let message = refused("rgb = {}", "explicit = []");
    assert!(message.contains("`explicit` is empty, it must have at least 1 entry"), "{message}");
}

#[test]
fn lists_have_one_entry_per_band() {
    let rule = "there are 3 bands, the list has 2 entries";
    holds(&refused("[0.9, 0.8, 0.7]", "[0.9, 0.8]"), rule, "6:62", "one number for all bands");
    holds(&refused("eta = 1.3", "eta = [1.3, 1.3]"), rule, "5:34", "");
    holds(&refused("irradiance = 1.0", "irradiance = [1, 2]"), rule, "10:50", "");
}

#[test]
fn coefficients_are_one_pair() {
    let rule = "exactly one pair of coefficients is needed, found `sigma_t_per_mm`";
    holds(
        &refused(COEFFICIENTS, "{ sigma_t_per_mm = 10, g = 0 }"),
        rule,
        "6:30",
        "(`sigma_t_per_mm`, `albedo`)",
    );
    let rule =
        "exactly one pair of coefficients is needed, found `sigma_t_per_mm`, `albedo`, `sigma_a_per_mm`";
    let three = "{ sigma_t_per_mm = 10, albedo = 0.5, sigma_a_per_mm = 1, g = 0 }";
    let message = refused(COEFFICIENTS, three);
    assert!(message.contains(rule), "{message}");
    for pair in
        ["sigma_a_per_mm = 1, sigma_s_per_mm = 2", "sigma_a_per_mm = 1, reduced_sigma_s_per_mm = 2"]
    {
        good(&GOOD.replace(COEFFICIENTS, &format!("{{ {pair}, g = 0.5 }}")));
    }
    good(&GOOD.replace(COEFFICIENTS, "{ sigma_t_per_mm = 0, albedo = 0, g = 0 }"));
}

#[test]
fn coefficients_are_in_range() {
    holds(&refused("0.8, 0.7]", "1.2, 0.7]"), "must be between 0 and 1, is 1.2", "6:68", "");
    let message = refused("sigma_t_per_mm = 10", "sigma_t_per_mm = -10");
    holds(&message, "must be at least 0, is -10", "6:49", "");
    holds(&refused("g = 0 }", "g = 1 }"), "must be between -1 and 1, both excluded, is 1", "6:83", "");
}

#[test]
fn a_conservative_half_space_is_refused() {
    let text = GOOD.replace("sphere = { radius_mm = 1.0 }", "half_space = {}");
    let rule = "a conservative half-space has walks of infinite mean length";
    holds(&errors(&text.replace("0.8, 0.7]", "1, 0.7]")), rule, "6:62", "band `G` absorbs nothing");
    let parts = "{ sigma_a_per_mm = 0, sigma_s_per_mm = 1, g = 0 }";
    holds(&errors(&text.replace(COEFFICIENTS, parts)), rule, "6:49", "band `R`");
    good(&text);
    good(
        &text.replace("half_space = {}", "slab = { thickness_mm = 1 }").replace("0.8, 0.7]", "1, 0.7]"),
    );
    good(&text.replace(COEFFICIENTS, "{ sigma_a_per_mm = 0, sigma_s_per_mm = 0, g = 0 }"));
}

#[test]
fn the_index_is_positive_and_real() {
    holds(&refused("eta = 1.3", "eta = 0"), "must be greater than 0, is 0", "5:34", "");
    holds(&refused("eta = 1.3", "eta = [1.3, -1, 1.3]"), "must be greater than 0, is -1", "5:40", "");
    let cauchy = "eta = { cauchy = { a = 1.5, b_um2 = 0.004 } }";
    let message = refused("eta = 1.3", cauchy);
    assert!(message.contains("dispersion needs wavelengths, and band `R` has none"), "{message}");
    assert!(message.contains("x.toml:5:34"), "{message}");
    good(&spectral("eta = 1.3", cauchy));
    good(&spectral("eta = 1.3", "eta = { material = \"bk7\" }"));
    good(&GOOD.replace("eta = 1.3", "eta = { material = \"skin1\" }"));
    let message = errors(&spectral("eta = 1.3", "eta = { sellmeier = { b = [1.0], c_um2 = [0.26] } }"));
    holds(&message, "the formula gives no positive real index at 450 nm", "5:34", "");
    let message = errors(&spectral("eta = 1.3", "eta = { sellmeier = { b = [1.0], c_um2 = [] } }"));
    holds(&message, "`b` has 1 entries, `c_um2` has 0", "5:69", "");
    let message = errors(&spectral("eta = 1.3", "eta = { material = \"skin\" }"));
    holds(&message, "unknown material `skin`", "5:47", "did you mean `skin2`?");
    let message = refused("smooth = { eta = 1.3 }", "matched = { eta = 1.3 }");
    holds(&message, "unknown key `eta`", "5:29", "there are no keys here");
}

#[test]
fn presets_need_rgb_and_a_known_name() {
    let preset = "medium.preset = { name = \"skin1\", scale = 2 }";
    let old = format!("medium.coefficients = {COEFFICIENTS}");
    good(&GOOD.replace(&old, preset));
    let message = refused(&old, &preset.replace("skin1", "skin"));
    holds(&message, "unknown material `skin`", "6:33", "did you mean `skin2`?");
    let message = errors(&spectral(&old, preset));
    holds(&message, "built-in materials are measured in rgb bands only", "6:24", "rgb = {}");
}

/// Emission stands beside every form of the medium, one number for all bands or one per band, and
/// replaces the lights; the key of another form replaces the form, not the emission.
#[test]
fn a_medium_may_emit() {
    let light = "[[light]]\ndirectional = { toward = [1, 1, 1], irradiance = 1.0 }\n";
    let old = format!("object.medium.coefficients = {COEFFICIENTS}\n");
    let with = |emission: &str| {
        GOOD.replace(&old, &format!("{old}object.medium.emission_per_mm = {emission}\n"))
    };
    let emission =
        |experiment: &crate::experiment::Experiment| experiment.cells[0].object.medium.emission(3);
    let dark = good(&with("[1, 0, 2.5]").replace(light, ""));
    assert_eq!((emission(&dark), dark.cells[0].light.len()), (vec![1.0, 0.0, 2.5], 0));
    assert_eq!(emission(&good(GOOD)), [0.0; 3]);
    let sets =
        ["object.medium.preset={ name = \"skin1\", scale = 2 }", "object.medium.emission_per_mm=4"];
    let preset = try_load(&with("[1, 0, 2.5]"), &sets).expect("a good file");
    assert!(preset.cells[0].object.medium.coefficients.is_none());
    assert_eq!(emission(&preset), [4.0; 3]);

    for dark in [GOOD.replace(light, ""), with("0").replace(light, "")] {
        assert!(errors(&dark).contains("missing key `light`"));
    }
    let message = errors(&with("[1, -1, 1]"));
    holds(&message, "must be at least 0, is -1", "7:37", "");
    let message = errors(&with("[1, 1]"));
    holds(&message, "there are 3 bands, the list has 2 entries", "7:33", "one number per band");
    let named = with("1").replace("[[light]]\n", "[[light]]\nname = \"emission\"\n");
    holds(&errors(&named), "`@emission` is the share of light that the medium emits", "11:8", "another");
    let clear = with("1").replace(COEFFICIENTS, "{ sigma_a_per_mm = 0, sigma_s_per_mm = 0, g = 0 }");
    good(&clear);
    let message = errors(&clear.replace("sphere = { radius_mm = 1.0 }", "half_space = {}"));
    holds(
        &message,
        "a half-space that emits and does not absorb has infinite radiance",
        "7:33",
        "band `R`",
    );
}

#[test]
fn shapes_have_positive_and_ordered_lengths() {
    let message = refused("sphere = { radius_mm = 1.0 }", "box = { size_mm = [1, 0, 1] }");
    holds(&message, "must be greater than 0, is 0", "4:36", "");
    let torus =
        "torus = { major_radius_mm = 1, minor_radius_mm = 2, segments = [8, 8], normals = \"flat\" }";
    let message = refused("sphere = { radius_mm = 1.0 }", torus);
    holds(&message, "must be less than `major_radius_mm`, is 2 of 1", "4:63", "");
    let cavity =
        "cavity_sphere = { radius_mm = 1, cavity_radius_mm = 1, subdivisions = 1, normals = \"flat\" }";
    let message = refused("sphere = { radius_mm = 1.0 }", cavity);
    holds(&message, "must be less than `radius_mm`, is 1 of 1", "4:66", "");
}

#[test]
fn directions_have_a_length_and_up_is_across_the_view() {
    let zero = "a direction must not be the zero vector";
    holds(&refused("toward = [0, 0, -1]", "toward = [0, 0, 0]"), zero, "7:49", "");
    holds(&refused("toward = [1, 1, 1]", "toward = [0, 0, 0]"), zero, "10:26", "");
    let camera = "sensor.orthographic = { resolution = [2, 2], center_mm = [0, 0, 3], toward = [0, 0, -1], \
                  up = [0, 0, 2], width_mm = 1 }";
    let parallel = "`up` must not be parallel to the view";
    holds(&refused(SENSOR, camera), parallel, "7:95", "");
    let pinhole = "sensor.perspective = { resolution = [2, 2], position_mm = [0, 0, 3], look_at_mm = [0, 0, 0], \
                   up = [0, 0, 1], fov_deg = 30 }";
    holds(&refused(SENSOR, pinhole), parallel, "7:99", "");
    let message = refused(SENSOR, &pinhole.replace("look_at_mm = [0, 0, 0]", "look_at_mm = [0, 0, 3]"));
    holds(&message, "`look_at_mm` must differ from `position_mm`", "7:83", "");
    let message = refused(LIGHT, "environment = { radiance = 1, hemisphere = [0, 0, 0] }");
    holds(&message, zero, "10:44", "");
}

#[test]
fn caps_of_directions_look_at_finite_bodies() {
    let camera = "sensor.orthographic = { resolution = [2, 2], center_mm = [0, 0, 3], toward = [0, 0, -1], \
                  up = [0, 1, 0], width_mm = 1, acceptance_sr = 0.1 }";
    let text = GOOD.replace(SENSOR, camera);
    good(&text);
    let message = errors(&text.replace("sphere = { radius_mm = 1.0 }", "half_space = {}"));
    assert!(message.contains("finite size only") && message.contains("x.toml:7:"), "{message}");
    let message = errors(&text.replace("acceptance_sr = 0.1", "acceptance_sr = 6.29"));
    assert!(message.contains("must be less than"), "{message}");
}

#[test]
fn fluxes_of_planes_are_about_z() {
    let flux = "sensor.flux = { bins = 4, axis = [0, 1, 1] }";
    let text = GOOD.replace("sphere = { radius_mm = 1.0 }", "slab = { thickness_mm = 1 }");
    let rule = "the axis must be +z on a half_space and on a slab";
    holds(&errors(&text.replace(SENSOR, flux)), rule, "7:34", "");
    let down = flux.replace("[0, 1, 1]", "[0, 0, -1]");
    holds(&errors(&text.replace(SENSOR, &down)), rule, "7:34", "");
    good(&GOOD.replace(SENSOR, flux));
    good(&text.replace(SENSOR, &flux.replace("[0, 1, 1]", "[0, 0, 2]")));
}

#[test]
fn lights_are_not_negative_and_have_unique_names() {
    holds(&refused("irradiance = 1.0", "irradiance = -1"), "must be at least 0, is -1", "10:50", "");
    let disc = "solid_angle = { toward = [0, 0, 1], solid_angle_sr = 7, irradiance = 1 }";
    holds(
        &refused(LIGHT, disc),
        "must be less than 2 pi beside `irradiance`, is 7",
        "10:54",
        "give `radiance`",
    );
    good(&GOOD.replace(LIGHT, &disc.replace("irradiance", "radiance")));
    let message = refused(LIGHT, "environment = { radiance = 1, scale = 2 }");
    holds(&message, "`scale` multiplies a `map`, and there is none", "10:39", "");
    let message = refused_with(&format!("[[light]]\nname = \"light_1\"\n{LIGHT}\n"));
    holds(&message, "two lights are named `light_1`", "15:8", "");
}

/// Rings lie on planes and widen.
#[test]
fn rings_widen_on_planes() {
    let rings = |edges: &str| {
        GOOD.replace("sphere = { radius_mm = 1.0 }", "half_space = {}")
            .replace(SENSOR, &format!("sensor.rings = {{ edges_mm = [{edges}] }}"))
    };
    good(&rings("0, 0.5, 1"));
    good(&rings("0.5, 1").replace("half_space = {}", "slab = { thickness_mm = 1 }"));
    let on_a_sphere = GOOD.replace(SENSOR, "sensor.rings = { edges_mm = [0, 1] }");
    holds(
        &errors(&on_a_sphere),
        "rings lie on the top face of a half_space or slab",
        "7:16",
        "another sensor",
    );
    holds(&errors(&rings("0, 1, 1")), "edges must increase, 1 follows 1", "7:36", "");
    holds(&errors(&rings("0, 2, 1")), "edges must increase, 1 follows 2", "7:36", "");
    holds(&errors(&rings("-1, 1")), "a radius must be at least 0, is -1", "7:30", "");
    assert!(errors(&rings("1")).contains("at least 2"));
}
