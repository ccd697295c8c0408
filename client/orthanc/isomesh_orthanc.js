// Orthanc Explorer: a button for each rule below "Interact" of a series. Runs in Orthanc's page, with its jQuery Mobile.
(function () {
  'use strict';
  const rules = RULES_OF_CONFIGURATION;
  const lines = {}; // by series and rule: what is known of its order, also after the user has looked at other series
  const words = {
    waiting: 'waiting until the series is complete',
    fetching: 'reading the images',
    meshing: 'making the mesh',
    sending: 'storing the mesh',
  };

  function show(key, text, order) {
    lines[key] = { text: text, order: order };
    $('.isomesh-line').filter(function () { return $(this).data('key') === key; }).each(function () { fill($(this)); });
  }

  function fill(line) {
    const known = lines[line.data('key')];
    line.toggle(known !== undefined);
    if (known === undefined) return;
    const text = $('<p style="white-space: normal; margin: 0.5em 0" role="status">').text(known.text);
    line.empty().append(text);
    if (known.order && known.order.link) {
      text.append(' ').append($('<a target="_blank" rel="noopener noreferrer">').attr('href', known.order.link).text('Show it in isomesh'));
    }
  }

  function sentence(order) {
    if (order.state === 'succeeded') return 'The mesh is in the study (' + order.results + (order.results === 1 ? ' object).' : ' objects).');
    if (order.state === 'failed') return 'The order failed: ' + order.error;
    if (order.state === 'cancelled') return 'The order was cancelled.';
    const far = order.progress === null ? '' : ', ' + Math.floor(100 * order.progress) + ' %';
    return 'isomesh is ' + words[order.state] + far + (order.error ? '. The last attempt failed: ' + order.error : '');
  }

  function hasEnded(order) {
    return order.state === 'succeeded' || order.state === 'failed' || order.state === 'cancelled';
  }

  function reason(failed) {
    try {
      return JSON.parse(failed.responseText).error || 'Orthanc answered with status ' + failed.status;
    } catch (error) {
      return failed.status === 0 ? 'Orthanc gave no answer.' : 'Orthanc answered with status ' + failed.status;
    }
  }

  function follow(key, order) {
    show(key, sentence(order), order);
    if (hasEnded(order)) return;
    setTimeout(function () {
      $.ajax({ url: '../isomesh/orders/' + order.id, dataType: 'json', cache: false })
        .done(function (next) { follow(key, next); })
        .fail(function (failed) {
          const more = Object.assign({}, order, { error: null });
          // isomesh goes on with an order that it has. It may be starting again.
          if (failed.status === 404) show(key, reason(failed), null);
          else { follow(key, more); show(key, sentence(more) + '. ' + reason(failed), more); }
        });
    }, 1000);
  }

  function start(series, rule) {
    const key = series + ' ' + rule;
    const known = lines[key];
    if (known && known.order && !hasEnded(known.order)) return;
    show(key, 'Ordering …', null);
    $.ajax({
      type: 'POST',
      url: '../isomesh/series/' + series,
      contentType: 'application/json',
      data: JSON.stringify({ rule: rule }),
      dataType: 'json',
    }).done(function (order) { follow(key, order); }).fail(function (failed) { show(key, reason(failed), null); });
  }

  $('#series').live('pagebeforeshow', function () {
    if (!$.mobile.pageData) return;
    const series = $.mobile.pageData.uuid;
    const list = $('#series-store').closest('ul');
    $('.isomesh', list).remove();
    rules.forEach(function (rule) {
      const link = $('<a href="#">').text('Mesh this series' + (rules.length > 1 ? ': ' + rule : '')).click(function (event) {
        event.preventDefault();
        start(series, rule);
      });
      list.append($('<li data-icon="gear" class="isomesh">').append(link));
      const line = $('<li class="isomesh isomesh-line">').data('key', series + ' ' + rule);
      list.append(line);
      fill(line);
    });
    list.listview('refresh');
  });
})();
