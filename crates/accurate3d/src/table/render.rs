use std::fmt;
use std::fmt::Write;
use std::str::FromStr;

use accurate_eval::{Dataset, Metric, published};
use serde_json::{Value, json};

use super::measure::{Table, TableRow};
use crate::UnknownName;

/// How a table is written to a file or to stdout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Markdown.
    Md,
    /// Comma-separated values.
    Csv,
    /// LaTeX with booktabs.
    Tex,
    /// A page of its own, for a browser.
    Html,
    /// JSON.
    Json,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 5] = [Self::Md, Self::Csv, Self::Tex, Self::Html, Self::Json];

    /// The name on the command line, and the extension of a file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Md => "md",
            Self::Csv => "csv",
            Self::Tex => "tex",
            Self::Html => "html",
            Self::Json => "json",
        }
    }
}

impl FromStr for Format {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| UnknownName {
            what: "format",
            name: name.to_owned(),
            expected: Self::ALL.map(Self::name).join(", "),
        })
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The table as text in the given format, with a final newline.
pub fn render(table: &Table, format: Format) -> String {
    match format {
        Format::Md => markdown(table),
        Format::Csv => csv(table),
        Format::Tex => latex(table),
        Format::Html => html(table),
        Format::Json => format!("{:#}\n", to_json(table)),
    }
}

/// Header and cells as text, for any grid: the paper's figure, ours with its interval, failures.
pub fn grid(table: &Table) -> (Vec<String>, Vec<Vec<String>>) {
    let columns = column_names(table);
    let mut header: Vec<String> =
        ["Method", "Input", "Calib."].iter().map(|s| (*s).to_owned()).collect();
    let shows_paper =
        dataset_of(&table.set).is_some() && columns.contains(&Metric::Accuracy.heading());
    for column in &columns {
        if shows_paper {
            header.push(format!("{column} (paper)"));
        }
        header.push((*column).to_owned());
    }
    header.push("failed".to_owned());
    let rows = table
        .rows
        .iter()
        .map(|row| {
            let mut cells = vec![
                row.row.label.to_owned(),
                row.row.input.to_string(),
                if row.row.calibrated { "yes" } else { "no" }.to_owned(),
            ];
            for column in &columns {
                if shows_paper {
                    cells.push(
                        paper_value(table, row, column)
                            .map_or_else(|| "-".to_owned(), |v| format!("{v:.4}")),
                    );
                }
                cells.push(match &row.result {
                    Ok(measured) => measured.columns.iter().find(|(n, _)| n == column).map_or_else(
                        || "-".to_owned(),
                        |(_, i)| {
                            if i.low == i.high {
                                number(i.value)
                            } else {
                                format!(
                                    "{} [{}, {}]",
                                    number(i.value),
                                    number(i.low),
                                    number(i.high)
                                )
                            }
                        },
                    ),
                    Err(reason) => format!("n/a ({reason})"),
                });
            }
            cells.push(match &row.result {
                Ok(m) => format!("{} of {}", m.failures().count(), m.cases.len()),
                Err(_) => "-".to_owned(),
            });
            cells
        })
        .collect();
    (header, rows)
}

/// Four significant digits, never fewer than four decimals below 10.
fn number(value: f64) -> String {
    if value.abs() < 10.0 { format!("{value:.4}") } else { format!("{value:.2}") }
}

/// The published data set that a family stands for.
fn dataset_of(set: &str) -> Option<Dataset> {
    match set {
        "sim-paper" => Some(Dataset::Simulation),
        "carm" => Some(Dataset::Phantom),
        _ => None,
    }
}

fn paper_value(table: &Table, row: &TableRow, column: &str) -> Option<f64> {
    let metric = Metric::ALL.into_iter().find(|metric| metric.heading() == column)?;
    Some(metric.of(&published(row.row.published?, dataset_of(&table.set)?)?.scores))
}

fn column_names(table: &Table) -> Vec<&'static str> {
    table
        .rows
        .iter()
        .filter_map(|row| row.result.as_ref().ok())
        .find(|m| !m.columns.is_empty())
        .map(|m| m.columns.iter().map(|(name, _)| *name).collect())
        .unwrap_or_default()
}

/// What stands over the table: the set, the cases, the unit, and how to read it.
fn caption(table: &Table) -> String {
    let paper = match dataset_of(&table.set) {
        Some(Dataset::Simulation) => {
            " Paper columns: its simulation set, headed \"pixel\" there but in world units."
        }
        Some(Dataset::Phantom) => {
            " Paper columns: its phantom set, which is not public here; ours is a generated set of \
             the same geometry, so the figures stand side by side but do not answer to each other."
        }
        None => "",
    };
    format!(
        "{}, {} cases, distances in {}; means with bootstrap 95 % intervals over the cases that \
         gave a curve.{paper}",
        table.set, table.cases, table.unit
    )
}

fn markdown(table: &Table) -> String {
    let (header, rows) = grid(table);
    let mut text = String::new();
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    text.push_str(&line(&header));
    let rule: Vec<String> = header
        .iter()
        .enumerate()
        .map(|(i, _)| if i < 3 { "---".to_owned() } else { "---:".to_owned() })
        .collect();
    text.push_str(&line(&rule));
    for row in &rows {
        text.push_str(&line(row));
    }
    let _ = write!(text, "\n{}\n", caption(table));
    text
}

fn csv(table: &Table) -> String {
    let mut text =
        String::from("set,cases,unit,label,input,metric,paper,value,low,high,scored,failed,note\n");
    for row in &table.rows {
        let lead = format!(
            "{},{},{},{},{}",
            quoted(&table.set),
            table.cases,
            table.unit,
            quoted(row.row.label),
            row.row.input
        );
        for column in column_names(table) {
            let paper = paper_value(table, row, column).map_or_else(String::new, |v| v.to_string());
            let ours = match &row.result {
                Ok(m) => m.columns.iter().find(|(n, _)| *n == column).map_or_else(
                    || format!(",,,{},{},no case gave a curve", m.scored(), m.failures().count()),
                    |(_, i)| {
                        format!(
                            "{},{},{},{},{},",
                            i.value,
                            i.low,
                            i.high,
                            m.scored(),
                            m.failures().count()
                        )
                    },
                ),
                Err(reason) => format!(",,,,,{reason}"),
            };
            let _ = writeln!(text, "{lead},{column},{paper},{ours}");
        }
    }
    text
}

/// A name in CSV: a path may hold a comma, and a quote.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}

/// A character as LaTeX sets it.
fn latex_of(character: char) -> String {
    match character {
        '%' | '&' | '_' | '#' | '$' | '{' | '}' => format!("\\{character}"),
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '<' => "$<$".to_owned(),
        '>' => "$>$".to_owned(),
        other => other.to_string(),
    }
}

fn latex(table: &Table) -> String {
    let (header, rows) = grid(table);
    let escape = |s: &String| s.chars().map(latex_of).collect::<String>();
    let line = |cells: &[String]| {
        format!("{} \\\\\n", cells.iter().map(escape).collect::<Vec<_>>().join(" & "))
    };
    let mut text = String::from("\\begin{table}\n\\centering\n");
    let _ = writeln!(text, "\\caption{{{}}}", escape(&caption(table)));
    let _ = writeln!(text, "\\begin{{tabular}}{{lll{}}}\n\\toprule", "r".repeat(header.len() - 3));
    text.push_str(&line(&header));
    text.push_str("\\midrule\n");
    for row in &rows {
        text.push_str(&line(row));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n\\end{table}\n");
    text
}

/// A page without scripts or outside files; figures are right-aligned, the published ones grey.
fn html(table: &Table) -> String {
    let escape = |s: &str| s.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let (header, rows) = grid(table);
    let row = |cells: &[String], tag: &str| {
        let cells: String = cells
            .iter()
            .zip(&header)
            .map(|(cell, column)| {
                let class = if column.ends_with("(paper)") { " class=\"paper\"" } else { "" };
                format!("<{tag}{class}>{}</{tag}>", escape(cell))
            })
            .collect();
        format!("<tr>{cells}</tr>\n")
    };
    let body: String = rows.iter().map(|cells| row(cells, "td")).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <style>\n\
         body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem; color: #1a1a1a; background: #fff }}\n\
         table {{ border-collapse: collapse; font-variant-numeric: tabular-nums }}\n\
         caption {{ caption-side: bottom; text-align: left; max-width: 60rem; padding-top: .75rem; color: #555 }}\n\
         th, td {{ padding: .3rem .8rem; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap }}\n\
         th:nth-child(-n+3), td:nth-child(-n+3) {{ text-align: left }}\n\
         thead th {{ border-bottom: 2px solid #333 }}\n\
         .paper {{ color: #777 }}\n\
         </style>\n<table>\n<caption>{caption} {note}</caption>\n\
         <thead>\n{head}</thead>\n<tbody>\n{body}</tbody>\n</table>\n</html>\n",
        title = escape(&format!("accurate: {}", table.set)),
        caption = escape(&caption(table)),
        note = crate::NOT_FOR_CLINICAL_USE,
        head = row(&header, "th"),
    )
}

fn to_json(table: &Table) -> Value {
    let rows: Vec<Value> = table
        .rows
        .iter()
        .map(|row| {
            let mut value = json!({
                "label": row.row.label,
                "input": row.row.input.name(),
                "calibrated": row.row.calibrated,
                "published_row": row.row.published,
            });
            match &row.result {
                Ok(m) => {
                    value["metrics"] = m
                        .columns
                        .iter()
                        .map(|(name, i)| {
                            let metric = json!({
                                "metric": name,
                                "paper": paper_value(table, row, name),
                                "value": i.value, "low": i.low, "high": i.high,
                            });
                            metric
                        })
                        .collect();
                    value["scored"] = json!(m.scored());
                    value["failures"] = m
                        .failures()
                        .map(|(case, reason)| json!({"case": case, "reason": reason}))
                        .collect();
                }
                Err(reason) => value["not_available"] = json!(reason),
            }
            value
        })
        .collect();
    json!({
        "set": table.set,
        "cases": table.cases,
        "unit": table.unit.label(),
        "caption": caption(table),
        "rows": rows,
    })
}

#[cfg(test)]
mod tests {
    use accurate_geom::LengthUnit;

    use super::*;

    #[test]
    fn a_set_may_have_any_name() {
        let name = "runs/my_set, \"50 %\" & more";
        let table = Table {
            set: name.to_owned(),
            cases: 0,
            unit: LengthUnit::Millimetre,
            rows: Vec::new(),
        };
        assert_eq!(quoted(&table.set), "\"runs/my_set, \"\"50 %\"\" & more\"");
        let tex = latex(&table);
        assert!(tex.contains("runs/my\\_set, \"50 \\%\" \\& more"), "{tex}");
        let special: String = "\\~^<>{}#$".chars().map(latex_of).collect();
        assert_eq!(
            special,
            "\\textbackslash{}\\textasciitilde{}\\textasciicircum{}$<$$>$\\{\\}\\#\\$"
        );
    }
}
