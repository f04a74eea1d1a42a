//! Every option as `/v1/options` describes it, uploads give it and the command
//! line sets it.

use serde_json::{Value, json};

use options::{merge, nested};

use super::{Options, parse, schema};

/// Dotted names of all options with their schemas.
fn leaves() -> Vec<(String, Value)> {
    fn walk(name: String, schema: &Value, found: &mut Vec<(String, Value)>) {
        let Some(properties) = schema["properties"].as_object() else {
            found.push((name, schema.clone()));
            return;
        };
        for (key, inner) in properties {
            let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
            walk(name, inner, found);
        }
    }
    let mut found = Vec::new();
    walk(String::new(), schema(), &mut found);
    found
}

fn is_number(schema: &Value) -> bool {
    let is = |kind: &Value| kind == "number" || kind == "integer";
    is(&schema["type"]) || schema["type"].as_array().is_some_and(|kinds| kinds.iter().any(is))
}

/// The values of a choice; with a meaning each, or several without.
fn choices(schema: &Value) -> Vec<Value> {
    let listed = schema["oneOf"].as_array().into_iter().flatten();
    let values = |choice: &Value| match choice["enum"].as_array() {
        Some(several) => several.clone(),
        None => vec![choice["const"].clone()],
    };
    listed.flat_map(values).collect()
}

/// The problem with one option set to `value`, as the command line would.
fn refusal(option: &str, value: &Value) -> String {
    let problems = parse(&nested(option, &value.to_string())).unwrap_err().0;
    let found = problems.iter().find(|problem| problem.option == option);
    found.unwrap_or_else(|| panic!("{option}={value}: {problems:?}")).detail.clone()
}

#[test]
fn every_option_says_what_it_is_its_default_and_its_range() {
    let leaves = leaves();
    assert!(leaves.len() > 70, "{}", leaves.len());
    for (option, schema) in leaves {
        assert!(schema["description"].as_str().is_some_and(|d| d.len() > 10), "{option}: {schema}");
        assert!(schema.get("default").is_some(), "{option} has no default");
        if is_number(&schema) {
            assert!(schema["minimum"].is_number() && schema["maximum"].is_number(), "{option}");
        }
        assert!(schema.get("oneOf").is_none() || choices(&schema).len() > 1, "{option}: {schema}");
        // The default is the default.
        let given = parse(&nested(&option, &schema["default"].to_string()));
        assert_eq!(given.as_ref(), Ok(&Options::default()), "{option}");
    }
}

#[test]
fn values_out_of_range_are_refused_with_the_range() {
    for (option, schema) in leaves().into_iter().filter(|(_, schema)| is_number(schema)) {
        let [low, high] = ["minimum", "maximum"].map(|end| schema[end].as_f64().unwrap());
        let range = format!("give {} to {}", schema["minimum"], schema["maximum"]);
        let whole = schema["type"] == "integer";
        for outside in [low - 1.0, high + 1.0] {
            let value = if whole { json!(outside as i64) } else { json!(outside) };
            let detail = refusal(&option, &value);
            assert!(detail.contains(&range), "{option}={value}: {detail}");
        }
        refusal(&option, &json!("many"));
    }
}

#[test]
fn choices_are_refused_unless_they_are_listed() {
    for (option, schema) in leaves() {
        let choices = choices(&schema);
        if !choices.is_empty() {
            refusal(&option, &json!("something_else"));
        }
        for value in choices {
            let mut given = nested(&option, &value.to_string());
            if option == "detection.detector" {
                merge(&mut given, json!({"detection": {"descriptor": "sift"}}));
            }
            if option == "export.forward" {
                let along_z = value.as_str().is_some_and(|axis| axis.ends_with('z'));
                merge(&mut given, json!({"export": {"up_axis": if along_z { "y" } else { "z" }}}));
            }
            assert!(parse(&given).is_ok(), "{option}={value}");
        }
    }
}

/// METHOD: the defaults of Arys 2020, tables 4.3 and 4.5, §3.3 to §3.7.
#[test]
fn the_dissertations_parameters_are_options_with_its_defaults() {
    let all = serde_json::to_value(Options::default()).unwrap();
    let tables = json!({
        "detection": {
            "detector": "shi_tomasi", "descriptor": "orb",
            "fast": {"threshold": 38},
            "orb": {"max_features": 450, "scale_factor": 1.125, "levels": 14, "first_level": 0,
                "patch_size_px": 37, "edge_threshold_px": 37, "fast_threshold": 6},
            "harris": {"max_corners": 1000, "quality": 0.011, "min_distance_px": 3.0,
                "block_size_px": 6, "gradient_size_px": 7, "k": 0.04},
            "shi_tomasi": {"max_corners": 1000, "quality": 0.1, "min_distance_px": 2.0,
                "block_size_px": 11, "gradient_size_px": 7},
            "sift": {"max_features": 1000, "octave_layers": 3, "contrast_threshold": 0.15,
                "edge_threshold": 22.0, "sigma_px": 1.6},
            "surf": {"hessian_threshold": 1000.0, "octaves": 2, "octave_layers": 4},
        },
        "matching": {"matcher": "brute_force", "cross_check": true, "ratio": null,
            "max_distance": null},
        "epipolar": {"estimator": "ransac", "max_error_px": 2.0, "confidence": 0.99,
            "max_mean_sampson_px2": 100.0},
        "disparity": {"algorithm": "sgbm", "mode": "five_path", "min_disparity_px": 0,
            "num_disparities": 32, "block_size": 37, "p1": 970, "p2": 5970,
            "max_left_right_difference_px": 14, "pre_filter_cap": 15, "uniqueness_percent": 0,
            "speckle_window_px": 200, "speckle_range_px": 2},
        "cloud": {"depth": "inverse", "source": "dense"},
    });
    for (stage, options) in tables.as_object().unwrap() {
        let mut expected = all[stage].clone();
        merge(&mut expected, options.clone());
        assert_eq!(all[stage], expected, "{stage}");
    }
}

#[test]
fn lists_are_options_too() {
    let options = parse(&nested("disparity.block_sizes", "[5, 15, 37]")).unwrap();
    assert_eq!(options.disparity.block_sizes, [5, 15, 37]);
    for wrong in ["[4]", "[257]", "[5, 5, 5, 5, 5, 5, 5, 5, 5]", "7"] {
        let problems = parse(&nested("disparity.block_sizes", wrong)).unwrap_err().0;
        assert!(problems[0].option.starts_with("disparity.block_sizes"), "{problems:?}");
    }
}
