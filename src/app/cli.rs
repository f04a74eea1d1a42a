//! The command line: its commands and what runs them.

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};

use super::config::{Config, ConfigArgs};
use super::draw::{self, DrawArgs};
use super::evaluate::{self, EvaluateArgs};
use super::failure::Failure;
use super::import::{self, ImportArgs};
use super::keys::{self, KeyCommand, TenantCommand};
use super::page::{self, PageArgs};
use super::reconstruct::{self, ReconstructArgs};
use super::study::{self, StudyArgs};
use super::{child, serve, telemetry};

/// Turns a model sheet into depth maps, metrics and a 3D draft
#[derive(Parser, Debug)]
#[command(name = "turnaround", version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Run the HTTP service and its workers
    Serve(ConfigArgs),
    /// Run workers alone, on the data folder of a service
    Worker(ConfigArgs),
    /// Reconstruct a sheet from local files, without a service
    Reconstruct(ReconstructArgs),
    /// Find the views on a page of drawings and make a sheet of them
    Page(PageArgs),
    /// Draw a model sheet from a 3D model, with its ground truth
    Draw(DrawArgs),
    /// Measure the turntable method on sheets with ground truth
    Evaluate(EvaluateArgs),
    /// Run the dissertation's study on a folder of sheets with truth
    Study(StudyArgs),
    /// Make, list and revoke the keys of a service
    #[command(subcommand)]
    Keys(KeyCommand),
    /// Make and list the tenants of a service, whose jobs are kept apart
    #[command(subcommand)]
    Tenants(TenantCommand),
    /// Move a stopped service's data folder into the database and the bucket of a farm
    Import(ImportArgs),
    /// Work on the jobs of the service that started this
    #[command(hide = true)]
    Child,
    /// Print the OpenAPI description of the service
    Openapi,
}

/// Parses the command line and runs what it asks for.
pub(super) fn run() -> Result<(), Failure> {
    let matches = Cli::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    match cli.command {
        Command::Serve(args) => serve::serve(&settings(args, &matches)?),
        Command::Worker(args) => serve::worker(&settings(args, &matches)?),
        Command::Reconstruct(args) => reconstruct::run(&args),
        Command::Page(args) => page::run(&args),
        Command::Draw(args) => draw::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Study(args) => study::run(&args),
        Command::Keys(command) => keys::keys(&command),
        Command::Tenants(command) => keys::tenants(&command),
        Command::Import(args) => import::run(&args),
        Command::Child => child::run(),
        Command::Openapi => {
            println!("{:#}", crate::http::openapi());
            Ok(())
        }
    }
}

fn settings(args: ConfigArgs, matches: &ArgMatches) -> Result<Config, Failure> {
    let (_, matches) = matches.subcommand().expect("clap requires a subcommand");
    let config = args.resolve(matches).map_err(Failure::Usage)?;
    telemetry::init(&config.log).map_err(Failure::Usage)?;
    Ok(config)
}
