// Subcommands of isomeshd other than serving: tokens, configuration, installation.
#pragma once

#include <memory>

namespace CLI {
class App;
}

namespace isomesh {

struct Options;

// Adds the subcommands to `cli`, which must outlive it, as `options` must.
class Commands {
 public:
  Commands(CLI::App& cli, const Options& options);
  ~Commands();
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  // True if `cli` has parsed one of them.
  bool asked() const;

  // Runs it and returns the exit status: 1 if it succeeded partly and has reported losses. Throws
  // Error.
  int run();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh
