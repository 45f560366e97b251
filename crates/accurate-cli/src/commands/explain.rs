use crate::args::ExplainArgs;
use crate::code::Code;
use crate::console::Console;
use crate::failure::Failure;

/// `accurate explain CODE`: what a code of an error means and what to do; without one, all of them.
pub fn run(args: &ExplainArgs, console: &Console) -> Result<(), Failure> {
    let codes: Vec<Code> = args.code.map_or_else(|| Code::ALL.to_vec(), |code| vec![code]);
    if console.json {
        let list: Vec<_> = codes
            .iter()
            .map(|code| {
                serde_json::json!({
                    "code": code.name(),
                    "exit": code.exit(),
                    "title": code.title(),
                    "explanation": code.explanation(),
                })
            })
            .collect();
        return console.json(&list);
    }
    for code in &codes {
        console.data(&format!("{code} (exit {}): {}", code.exit(), code.title()))?;
        if args.code.is_some() {
            console.data(&format!("\n{}", code.explanation()))?;
        }
    }
    Ok(())
}
