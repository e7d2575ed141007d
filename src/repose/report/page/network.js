// The networks with their error: what repose.calibrate.surrogates.network_ensemble computes, for one network or several.
"use strict";

function unpacked(text, Kind) {
  return new Kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

function width(low, high) {
  return low.map((value, k) => (high[k] > value ? high[k] - value : 1));
}

// From a parameter set to {mean, std}, arrays of one number for each response; std is that of the mean, without noise.
function networkPredictor(model) {
  const members = model.members.map((one) => memberPredictor({ ...model, ...one }));
  const average = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  return function (X) {
    const found = members.map((predict) => predict(X));
    const mean = found[0].mean.map((_, k) => average(found.map((one) => one.mean[k])));
    const std = mean.map((value, k) => Math.sqrt(average(found.map((one) => one.std[k] ** 2 + (one.mean[k] - value) ** 2))));
    return { mean, std };
  };
}

// The same of one network.
function memberPredictor(network) {
  const root = unpacked(network.root, Float32Array);
  const [bottom, top] = network.scaled_range;
  const inputWidth = width(network.input_min, network.input_max);
  const stretch = width(network.output_min, network.output_max).map((value) => value / (top - bottom));
  const hidden = network.b1.length, inputs = inputWidth.length, outputs = network.b2.length;
  const N = hidden * (inputs + 1) + outputs * (hidden + 1);

  return function (X) {
    const x = X.map((value, i) => bottom + ((value - network.input_min[i]) / inputWidth[i]) * (top - bottom));
    const a = network.b1.map((bias, j) => Math.tanh(x.reduce((sum, value, i) => sum + network.W1[j][i] * value, bias)));
    const mean = [], std = [];
    for (let k = 0; k < outputs; k++) {
      const y = a.reduce((sum, value, j) => sum + network.W2[k][j] * value, network.b2[k]);
      mean.push(network.output_min[k] + (y - bottom) * stretch[k]);
      // The derivatives of this output by the N weights, in their order: W1, b1, W2, b2.
      const gradient = new Float64Array(N);
      for (let j = 0; j < hidden; j++) {
        const through = network.W2[k][j] * (1 - a[j] * a[j]);
        for (let i = 0; i < inputs; i++) gradient[j * inputs + i] = through * x[i];
        gradient[hidden * inputs + j] = through;
        gradient[hidden * (inputs + 1) + k * hidden + j] = a[j];
      }
      gradient[N - outputs + k] = 1;
      let variance = 0;
      for (let column = 0; column < N; column++) {
        let sum = 0;
        for (let row = 0; row < N; row++) sum += gradient[row] * root[row * N + column];
        variance += sum * sum;
      }
      std.push(Math.sqrt(variance) * stretch[k]);
    }
    return { mean, std };
  };
}
