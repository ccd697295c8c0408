// The fields of orders, as in fields.h. Requests have rows, for request_reader.h. Private to this
// folder.
#pragma once

#include "proto/fields.h"
#include "proto/orders.h"

namespace isomesh {

void visit(Is<OrderSource> auto& self, auto&& field) {
  field(Parameter{.name = "pacs", .is_required = true}, self.pacs);
  field(Parameter{.name = "study", .is_required = true}, self.study);
  field(Parameter{.name = "series", .is_required = true}, self.series);
  field(Parameter{.name = "instances"}, self.instances);
}

void visit(Is<SendTarget> auto& self, auto&& field) {
  field(Parameter{.name = "pacs", .is_required = true}, self.pacs);
  field(Parameter{.name = "format"}, self.format);
}

void visit(Is<OrderResult> auto& self, auto&& field) {
  field("pacs", self.pacs);
  field("format", self.format);
  field("label", self.label);
  field("sop_class_uid", self.sop_class_uid);
  field("series_uid", self.series_uid);
  field("sop_instance_uid", self.sop_instance_uid);
  field("bytes", self.bytes);
  field("stored", self.stored);
}

void visit(Is<Order> auto& self, auto&& field) {
  field("id", self.id);
  field("state", self.state);
  field("rule", self.rule);
  field("source", self.source);
  field("parameters", self.parameters);
  field("priority", self.priority);
  field("send", self.send);
  field("volume", self.volume);
  field("job", self.job);
  field("results", self.results);
  field("attempts", self.attempts);
  field("next_attempt", self.next_attempt);
  field("created", self.created);
  field("finished", self.finished);
  field("error", self.error);
}

// Omits `parameters`, which parse_order_parameters reads.
void visit(Is<OrderRequest> auto& self, auto&& field) {
  field(Parameter{.name = "source", .is_required = true}, self.source);
  field(Parameter{.name = "rule"}, self.rule);
  field(Parameter{.name = "send"}, self.send);
  field(Parameter{.name = "priority"}, self.priority);
  field(Parameter{.name = "callback"}, self.callback);
}

void visit(Is<OrderWork> auto& self, auto&& field) {
  field("listed", self.listed);
  field("listed_since", self.listed_since);
  field("failures", self.failures);
  field("looks", self.looks);
  field("begun", self.begun);
  field("identity", self.identity);
  field("labels", self.labels);
  field("blobs", self.blobs);
  field("label", self.label);
  field("series_number", self.series_number);
  field("callback", self.callback);
  field("max_error_mm", self.max_error_mm);
  field("triangles", self.triangles);
  field("queried", self.queried);
  field("sending", self.sending);
  field("failed_in", self.failed_in);
  field("contents", self.contents);
}

void visit(Is<PacsStatus> auto& self, auto&& field) {
  field("name", self.name);
  field("last_success", self.last_success);
  field("last_failure", self.last_failure);
  field("reason", self.reason);
}

}  // namespace isomesh
