//! Models as experiment files write them.

use super::super::{FittedDipole, Model, MomentKind, Outgoing, Scaling};

fn model(text: &str) -> Result<Model, serde_json::Error> {
    serde_json::from_str(text)
}

/// Every key is taken as written, and a missing key is exact, plain, the searchlight, six terms.
#[test]
fn words_of_every_model() {
    let exact = MomentKind::Exact;
    let polynomial = MomentKind::Polynomial;
    for (text, expected) in [
        (r#"{"classical": {}}"#, Model::Classical { moments: exact, outgoing: Outgoing::Plain }),
        (
            r#"{"classical": {"moments": "polynomial", "outgoing": "normalized"}}"#,
            Model::Classical { moments: polynomial, outgoing: Outgoing::Normalized },
        ),
        (r#"{"better": {}}"#, Model::Better { moments: exact }),
        (r#"{"better": {"moments": "polynomial"}}"#, Model::Better { moments: polynomial }),
        (r#"{"directional": {}}"#, Model::Directional { moments: exact }),
        (r#"{"normalized": {}}"#, Model::Normalized { scaling: Scaling::Searchlight, albedo: None }),
        (
            r#"{"normalized": {"scaling": "diffuse", "albedo": [0.5]}}"#,
            Model::Normalized { scaling: Scaling::Diffuse, albedo: Some(vec![0.5]) },
        ),
        (
            r#"{"normalized": {"scaling": "diffuse_mean_free_path"}}"#,
            Model::Normalized { scaling: Scaling::DiffuseMeanFreePath, albedo: None },
        ),
        (r#"{"skin": {"reflectance": [0.4, 0.2, 0.1]}}"#, Model::Skin { reflectance: [0.4, 0.2, 0.1] }),
        (
            r#"{"gaussians": {"dipole": "better"}}"#,
            Model::Gaussians { dipole: FittedDipole::Better, moments: exact, terms: 6 },
        ),
        (
            r#"{"gaussians": {"dipole": "classical", "moments": "polynomial", "terms": 4}}"#,
            Model::Gaussians { dipole: FittedDipole::Classical, moments: polynomial, terms: 4 },
        ),
    ] {
        assert_eq!(model(text).unwrap(), expected, "{text}");
    }
    for text in [
        r#"{"better": {"outgoing": "plain"}}"#,
        r#"{"skin": {}}"#,
        r#"{"skin": {"reflectance": [0.4]}}"#,
        r#"{"gaussians": {}}"#,
        r#"{"quantized": {}}"#,
    ] {
        assert!(model(text).is_err(), "{text}");
    }
}

/// Every model in the table of docs/bssrdf.md, with every option value that its row names, is accepted.
#[test]
fn the_documented_values_are_accepted() {
    let page = include_str!("../../../../docs/bssrdf.md");
    let models = page.split("## Models").nth(1).and_then(|rest| rest.split("\n## ").next()).unwrap();
    let mut count = 0;
    for row in models.lines().filter(|line| line.starts_with("| `")) {
        let table: serde_json::Value = toml::from_str(row.split('`').nth(1).unwrap()).unwrap();
        let kind = table.as_object().unwrap().keys().next().unwrap();
        assert!(serde_json::from_value::<Model>(table.clone()).is_ok(), "{table}");
        for value in row.split('"').skip(1).step_by(2) {
            let accepts = |key: &str| {
                let mut table = table.clone();
                table[kind][key] = value.into();
                serde_json::from_value::<Model>(table).is_ok()
            };
            assert!(
                ["moments", "outgoing", "scaling", "dipole"].into_iter().any(accepts),
                "{kind}: {value}"
            );
            count += 1;
        }
    }
    assert!(count >= 6, "{count} values");
}
