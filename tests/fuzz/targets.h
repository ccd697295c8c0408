// Readers of untrusted bytes, each as a function of bytes, for libFuzzer and for the replay of the
// corpora.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::fuzz {

struct Target {
  std::string_view name;
  // Refuses or reads; anything else is a finding, and ends the program.
  std::function<void(std::span<const std::byte> bytes)> run;
};

// Every reader of uploads has one, besides those of parts of readers.
const std::vector<Target>& targets();

// Throws std::out_of_range.
const Target& target(std::string_view name);

// Small inputs to start from, made here: every format in several variants.
std::vector<std::string> corpus(std::string_view target_name);

}  // namespace isomesh::fuzz
