// One row of the table of parameters (proto/parameters.h).
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>

#include "proto/mesh_summary.h"
#include "proto/smoothing.h"

namespace isomesh {

template <class T>
concept Enumeration = std::is_enum_v<T>;

template <class Self, class T>
concept Is = std::same_as<std::remove_const_t<Self>, T>;

// The values that differ for one method of smoothing.
struct SmoothingCase {
  Smoothing smoothing;
  std::optional<double> standard = {};
  std::optional<double> maximum = {};
};

// Methods that differ; empty if none does.
using SmoothingCases = std::span<const SmoothingCase>;

inline constexpr std::size_t kMostValues = 8;
using Meanings = std::array<const char*, kMostValues>;

enum class JobKind { kAny, kAtIso, kByLabels };
enum class TextKind { kAny, kName, kColor };  // of a text: one line, or "#rrggbb"

struct Parameter {
  const char* name;
  const char* title = "";  // a short label
  const char* help = "";   // what it does, in one line
  const char* more = "";   // further sentences for readers of the API
  const char* unit = "";   // also the name's ending, as in max_displacement_mm
  std::optional<double> minimum = {};
  std::optional<double> above = {};
  std::optional<double> maximum = {};
  const char* when_empty = nullptr;  // the word for no value, instead of JSON's null
  bool takes_presets = false;        // their names, instead of a number
  Meanings values = {};              // of an enumeration's values, in order
  SmoothingCases cases = {};
  bool is_required = false;
  const char* unless = nullptr;  // the parameter that takes the place of a required one
  JobKind jobs = JobKind::kAny;
  const char* by_labels = nullptr;       // why a job by labels takes only the default
  std::optional<MeshFormat> needs = {};  // the format without which it takes only the default
  TextKind text = TextKind::kAny;
  bool may_be_absent = false;  // omitted for jobs that it does not concern
  bool in_query = true;
  const char* query = nullptr;   // its name in a query, if it is not `name`
  const char* option = nullptr;  // its name on the command line, if it is not the query's

  operator const char*() const { return name; }
};

}  // namespace isomesh
