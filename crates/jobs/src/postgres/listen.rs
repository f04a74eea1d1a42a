//! Changes told from node to node by NOTIFY.

use std::sync::Arc;
use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgListener, PgPoolOptions};
use tokio::sync::broadcast;

use super::{Connection, PostgresStore, backend};
use crate::{EventKind, JobChange, StoreError};

const CHANNEL: &str = "turnaround";
/// Before the database is asked again that could not be listened to.
const PAUSE: Duration = Duration::from_secs(1);

/// Tells the other nodes of a change when its transaction is committed. Progress
/// is left to their polling: it comes often, and commits that notify are done
/// one after the other.
pub(super) async fn announce(
    store: &PostgresStore,
    connection: &mut Connection,
    change: JobChange,
) -> Result<(), StoreError> {
    if change.kind == EventKind::Progress {
        return Ok(());
    }
    let kind = super::rows::name(&change.kind)?;
    let told = format!("{} {} {kind} {}", store.node, change.id, change.version);
    sqlx::query("SELECT pg_notify($1, $2)")
        .bind(CHANNEL)
        .bind(told)
        .execute(connection)
        .await
        .map_err(backend)?;
    Ok(())
}

/// Passes on what other nodes tell, for ever, on a connection of its own. What
/// is told while there is none is missed: the listeners poll besides.
pub(super) async fn listen(
    target: Arc<PgConnectOptions>,
    own: String,
    changes: broadcast::Sender<JobChange>,
) {
    let pool = PgPoolOptions::new().max_connections(1).connect_lazy_with((*target).clone());
    loop {
        if let Err(error) = follow(&pool, &own, &changes).await {
            tracing::warn!(%error, "not told of changes by other nodes; they are found by polling");
        }
        tokio::time::sleep(PAUSE).await;
    }
}

async fn follow(
    pool: &sqlx::PgPool,
    own: &str,
    changes: &broadcast::Sender<JobChange>,
) -> sqlx::Result<()> {
    let mut listener = PgListener::connect_with(pool).await?;
    listener.listen(CHANNEL).await?;
    // `None` is a lost connection, which the next call makes anew.
    loop {
        let Some(told) = listener.try_recv().await? else { continue };
        if let Some(change) = read(told.payload(), own) {
            // An error only means that nobody listens.
            let _ = changes.send(change);
        }
    }
}

/// What another node tells; `None` if it is this one, or of a later version.
fn read(told: &str, own: &str) -> Option<JobChange> {
    let mut words = told.split(' ');
    if words.next()? == own {
        return None;
    }
    let id = words.next()?.parse().ok()?;
    let kind = serde_json::from_value(words.next()?.into()).ok()?;
    Some(JobChange { id, kind, version: words.next()?.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JobId;

    #[test]
    fn changes_of_others_are_read_and_no_more() {
        let id = JobId::new();
        let change = JobChange { id, kind: EventKind::CancelRequested, version: 3 };
        assert_eq!(read(&format!("b {id} cancel_requested 3"), "a"), Some(change));
        for none in ["", "b", "b x queued 1", &format!("b {id} unheard_of 1"), &format!("b {id}")] {
            assert_eq!(read(none, "a"), None, "{none}");
        }
        assert_eq!(read(&format!("a {id} queued 1"), "a"), None);
    }
}
