// People search for flags as they are written: `--traffic`. To the theme's search a leading `-` means "without this word",
// so it is taken out of each query on the way to the theme's worker. Message type 2 is a query.
const send = Worker.prototype.postMessage;
Worker.prototype.postMessage = function (message, ...rest) {
  const isQuery = message?.type === 2 && typeof message.data === 'string';
  const sent = isQuery ? { ...message, data: message.data.replace(/(^|\s)-+(?=\w)/g, '$1') } : message;
  return send.call(this, sent, ...rest);
};
