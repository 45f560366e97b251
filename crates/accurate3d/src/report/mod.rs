//! The report: one HTML file that shows a reconstruction and needs no network.

mod content;
mod images;

pub(crate) use images::cost_url;

use serde_json::Value;

use crate::{Error, Reconstruction, ViewPair};

/// The page with its script and style, built from `web/report` and committed.
const PAGE: &str = include_str!("../../assets/report.html");
const SLOT: &str = "{{DATA}}";

/// Where a result comes from, for its report.
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// The pair as the user named it.
    pub pair: String,
    /// Stage and parameters that took effect there.
    pub parameters: Vec<(String, String)>,
    /// File and BLAKE3 hash of every input.
    pub inputs: Vec<(String, String)>,
}

/// The report of a reconstruction as one HTML file: 3D curve with uncertainty, both views with trace
/// and epipolar lines, correspondences, candidates, junction decisions, scores (any JSON object),
/// diagnostics and provenance.
///
/// Complete in itself; a content security policy forbids every request. The same input gives the
/// same bytes.
///
/// # Errors
/// [`Error::Report`] if an image cannot be encoded.
pub fn report_html(
    pair: &ViewPair,
    reconstruction: &Reconstruction,
    scores: Option<&Value>,
    provenance: &Provenance,
) -> Result<String, Error> {
    let content = content::content(pair, reconstruction, scores, provenance)?;
    // `<` would let a name end the script element; in JSON its escape is the same text.
    let json = content.to_string().replace('<', "\\u003c").replace('\u{2028}', "\\u2028");
    let (before, after) = PAGE.split_once(SLOT).unwrap_or((PAGE, ""));
    let mut html = String::with_capacity(PAGE.len() + json.len());
    html.push_str(before);
    html.push_str(&json);
    html.push_str(after);
    Ok(html)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{InputKind, Method, Params, reconstruct};
    use accurate_synth::{CaseOptions, Family, generate};

    fn provenance() -> Provenance {
        Provenance {
            version: "0".into(),
            pair: "a </script><b>pair".into(),
            parameters: vec![("stage".into(), "Params { a: 1 }".into())],
            inputs: vec![("masks/mask_L.png".into(), "00ff".into())],
        }
    }

    fn report(method: Method, input: InputKind) -> (Reconstruction, String) {
        let case = generate(Family::Medium, 1700, 0, &CaseOptions::default()).unwrap();
        let mut pair = ViewPair::from(case);
        pair.id = "</script><script>alert(1)</script>".to_owned();
        let reconstruction = reconstruct(&pair, &Params::new(input, method)).unwrap();
        let html = report_html(&pair, &reconstruction, None, &provenance()).unwrap();
        assert_eq!(html, report_html(&pair, &reconstruction, None, &provenance()).unwrap());
        (reconstruction, html)
    }

    fn embedded(html: &str) -> Value {
        let start = html.find("id=\"data\">").unwrap() + "id=\"data\">".len();
        let end = start + html[start..].find("</script>").unwrap();
        serde_json::from_str(&html[start..end]).unwrap()
    }

    #[test]
    fn the_page_has_one_slot_and_asks_for_nothing_from_outside() {
        assert_eq!(PAGE.matches(SLOT).count(), 1);
        assert!(PAGE.contains("default-src 'none'"));
        for tag in ["<link", "src=\"http", "@import", "url(http"] {
            assert!(!PAGE.contains(tag), "{tag}");
        }
        assert!(PAGE.contains("MIT License"), "the bundled library's licence is there");
    }

    #[test]
    fn names_stay_text_and_the_data_say_what_the_result_says() {
        for (method, input) in [
            (Method::Accurate, InputKind::Mask),
            (Method::Accurate, InputKind::Points),
            (Method::Paper, InputKind::Mask),
        ] {
            let (reconstruction, html) = report(method, input);
            assert!(!html.contains("alert(1)</script>"));
            let data = embedded(&html);
            assert_eq!(data["case"], reconstruction.id.as_str());
            let points = data["curve"]["points"].as_array().unwrap();
            assert_eq!(points.len(), reconstruction.points.len());
            // Printed to a millionth of the curve's extent.
            let extent = reconstruction.length();
            for (read, point) in points.iter().zip(&reconstruction.points) {
                for axis in 0..3 {
                    let difference = read[axis].as_f64().unwrap() - point.position[axis];
                    assert!(difference.abs() < 1e-6 * extent, "{difference}");
                }
            }
            assert_eq!(data["views"][1]["trace"].as_array().unwrap().len(), {
                reconstruction.traces.points2.len()
            });
            let candidates = data["candidates"].as_array().unwrap();
            assert_eq!(
                candidates.is_empty(),
                !(method == Method::Accurate && input == InputKind::Mask)
            );
            assert_eq!(data["curve"]["sigma"].is_null(), reconstruction.covariances.is_none());
        }
    }
}
