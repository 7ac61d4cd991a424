//! The `trixel` command.

mod animate;
mod args;
mod attributes;
mod bench;
mod bench_effects;
mod engine;
mod grid;
mod info;
mod memory;
mod mesh;
mod out_of_core;
mod progress;
mod render;
mod render_args;
mod report;
mod tune;
mod tuned;
mod verify;
mod volume;
mod voxelize;
mod voxels;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::{Cli, Command};

fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.command {
        Command::Voxelize(args) => voxelize::run(*args),
        Command::Info(args) => info::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Render(args) => render::run(&args),
        Command::Animate(args) => animate::run(&args),
        Command::Tune(args) => tune::run(args),
        Command::Bench(args) => bench::run(&args),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Cli::command(), "trixel", &mut std::io::stdout());
            Ok(ExitCode::SUCCESS)
        }
    };
    outcome.unwrap_or_else(|error| {
        progress::error(&error);
        ExitCode::FAILURE
    })
}
