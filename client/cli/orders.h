// The commands about orders.
#pragma once

#include <stop_token>

#include "client/cli/options.h"
#include "client/isomesh/client.h"

namespace CLI {
class App;
}

namespace isomesh::cli {

// The arguments of `isomesh order`.
void add_order_options(CLI::App& app, Options& options);
// The arguments of `isomesh orders`.
void add_orders_options(CLI::App& app, Options& options);

// Orders, waits for the end unless it is not to, and says how long each step took. Returns the exit
// status.
int order(Client& client, const Options& options);

// Shows, cancels or tries again one order, or lists them.
int orders(Client& client, const Options& options);

// Lists the PACS.
int pacs(Client& client, const Options& options);

}  // namespace isomesh::cli
