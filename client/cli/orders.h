// The commands for orders.
#pragma once

#include <stop_token>

#include "client/cli/options.h"
#include "client/isomesh/client.h"

namespace CLI {
class App;
}

namespace isomesh::cli {

void add_order_options(CLI::App& app, Options& options);
void add_orders_options(CLI::App& app, Options& options);

// Places an order, waits for its end unless told not to, and reports the time of each step. Returns
// the exit status.
int order(Client& client, const Options& options);

// Shows, cancels or retries one order, or lists all.
int orders(Client& client, const Options& options);

int pacs(Client& client, const Options& options);

}  // namespace isomesh::cli
